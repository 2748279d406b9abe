"""The roll angle that distinguishes a rig at rest on its table from one in flight."""

from __future__ import annotations

import math

ON_TABLE_BELOW = math.radians(-15.0)
"""rad; a rig whose roll starts below this angle counts as at rest on its table. A recording whose
roll is never below it has no table. Chosen between a rig's rest, about −27°, and flight."""
