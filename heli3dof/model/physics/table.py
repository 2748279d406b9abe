"""The table on which a rig rests before and after a flight."""

from __future__ import annotations

import math

ON_TABLE_BELOW = math.radians(-15.0)
"""rad: a flight that starts with roll below this starts on the table, and one whose roll never
falls below it has no table. A convention between a rig's rest, about −27°, and angles in flight."""
