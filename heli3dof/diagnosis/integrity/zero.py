"""Was roll's zero set? Counts are zero at power-up, with the arm on the table.

A log that takes the angle for counts · 2π / N forgets the rest angle r_0 (−27.5°): the arm starts
at 0° instead, never goes below it, and flies about −r_0. So it is where

    |r(0) − (r_0 − r_0)| < NEAR,   min r > r(0) − NEAR,   median r in flight > SHARE · |r_0|

A flight that is let go level goes below its start, or stays near it.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from heli3dof.axes import ROLL
from heli3dof.diagnosis.integrity.base import Check, Fault, Kind, Stage
from heli3dof.diagnosis.integrity.view import View

NEAR = np.radians(3.0)
SHARE = 0.6
TABLE = np.radians(-15.0)


def zero(view: View) -> Iterable[Fault]:
    r = view.recording
    rest = float(r.profile.encoder.rest_rad[ROLL])
    roll = r.angle[view.read, ROLL]
    if ROLL not in view.measured or rest > TABLE or len(roll) < 100:
        return
    start = float(np.median(roll[:5]))
    up = roll[roll > start + NEAR]
    if abs(start) > NEAR or roll.min() < start - NEAR or len(up) < 0.5 * len(roll):
        return
    about = float(np.median(up))
    if about < SHARE * abs(rest):
        return
    size = np.degrees(start - rest)
    yield Fault(
        "encoder.zero", Kind.BAD_DATA, r.name,
        f"{r.name}: roll starts at {np.degrees(start):.3g}°, never goes below it and flies near "
        f"{np.degrees(about):.3g}°; the profile's rest angle is {np.degrees(rest):.4g}°.",
        "roll was zeroed with the arm on the table instead of level.",
        f"add {-size:.4g}° to the logged roll, or set encoder.roll_rest_deg to the rest angle",
        effect="encoder.offset", axis="roll",
        parameters={"angle_deg": (float(size), float(np.degrees(NEAR)))}, confidence=0.95,
    )  # fmt: skip


CHECKS = (Check("encoder.zero", Stage.VALUES, "roll zeroed on the table instead of level", zero),)
