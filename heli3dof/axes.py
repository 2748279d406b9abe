"""The three axes and two motors, in the order every array uses.

- Roll *r*: elevation angle of the arm, positive with the body up.
- Pitch *p*: tilt angle of the body, positive with the front motor up.
- Yaw *ψ*: travel angle of the arm, positive counter-clockwise, as in the paper.

Angle arrays have the columns ``(roll, pitch, yaw)``, voltage arrays ``(front, back)``.
"""

from __future__ import annotations

AXES = ("roll", "pitch", "yaw")
MOTORS = ("front", "back")
ROLL, PITCH, YAW = range(3)
FRONT, BACK = range(2)
ALIASES = {"elevation": "roll", "travel": "yaw"}
