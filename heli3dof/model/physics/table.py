"""The roll angle that distinguishes a rig at rest on its table from one in flight."""

from __future__ import annotations

import math

ON_TABLE_BELOW = math.radians(-15.0)
"""rad, roll at which a rig counts as on its table at the start; a recording whose roll never falls
below has no table. Chosen between a rig's rest, about −27°, and angles in flight."""
