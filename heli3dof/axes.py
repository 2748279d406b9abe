"""The three axes and two motors, in the order every array uses.

Roll *r* is the elevation of the arm (+ body up), pitch *p* the tilt of the body (+ front motor
up), yaw *ψ* the travel (+ counter-clockwise), as in the paper. Columns of an angle array are
``(roll, pitch, yaw)``; columns of a voltage array are ``(front, back)``.
"""

from __future__ import annotations

AXES = ("roll", "pitch", "yaw")
MOTORS = ("front", "back")
ROLL, PITCH, YAW = range(3)
FRONT, BACK = range(2)
ALIASES = {"elevation": "roll", "travel": "yaw"}
