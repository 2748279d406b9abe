"""Report a roll encoder that was zeroed with the arm on the table instead of level.

Counts are zero at power-up, when the arm rests on the table at r_0 (−27.5°). A log that converts
counts without adding r_0 starts at 0° and hovers near −r_0. Let r(0) be the median of the first
five samples. The check reports this fault if all of these hold:

- r_0 is below `ON_TABLE_BELOW`.
- |r(0)| < `NEAR`, and no sample is below r(0) − `NEAR`.
- At least half of the samples are above r(0) + `NEAR`. The median of these is at least `SHARE`
  |r_0|.
- The gravity torque is largest at an angle nearer to −r_0 than to 0 (`Response.level_rad`). This
  excludes a flight that starts level in mid-air and then flies at 20°.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from heli3dof.axes import ROLL
from heli3dof.integrity.base import Check, Fault, Kind, Stage
from heli3dof.integrity.remedies import column_of, is_log, log_remedy
from heli3dof.integrity.view import View
from heli3dof.model.estimation.filter_data import ON_TABLE_BELOW
from heli3dof.recording.recording import Recording

NEAR = np.radians(3.0)
"""rad; also the standard deviation of the reported angle"""
SHARE = 0.6
"""Least median rise, as a share of |r_0|. Chosen, like `NEAR`; not derived."""


def zero(view: View) -> Iterable[Fault]:
    r = view.recording
    rest = float(r.profile.encoder.rest_rad[ROLL])
    roll = r.angle[view.finite_rows, ROLL]
    if ROLL not in view.measured or rest > ON_TABLE_BELOW or len(roll) < 100:
        return
    start = float(np.median(roll[:5]))
    raised = roll[roll > start + NEAR]
    if abs(start) > NEAR or roll.min() < start - NEAR or len(raised) < 0.5 * len(roll):
        return
    hover = float(np.median(raised))
    if hover < SHARE * abs(rest):
        return
    response = view.responses.get("roll")
    if response is not None and response.level_rad < 0.5 * abs(rest):
        return
    size = np.degrees(start - rest)
    yield Fault(
        "encoder.zero", Kind.BAD_DATA, r.name,
        f"{r.name}: roll starts at {np.degrees(start):.3g}°, never goes below it and flies near "
        f"{np.degrees(hover):.3g}°; the profile's rest angle is {np.degrees(rest):.4g}°.",
        "roll was zeroed with the arm on the table instead of level.",
        _remedy(r, start - rest),
        effect="encoder.offset", axis="roll",
        parameters={"angle_deg": (float(size), float(np.degrees(NEAR)))}, confidence=0.95,
    )  # fmt: skip


def _remedy(recording: Recording, error_rad: float) -> str:
    """Return how to correct a roll that is too large by ``error_rad``."""
    error_deg = np.degrees(error_rad)
    if not is_log(recording):
        return (
            f"subtract {error_deg:.4g}° from roll; on the rig: heli3dof zero with the arm on the "
            "table, and record again"
        )
    in_rad = column_of(recording, "roll")[0].endswith("_rad")
    return log_remedy(recording, "roll", f"{{}} - {error_rad if in_rad else error_deg:.4g}")


CHECKS = (Check("encoder.zero", Stage.VALUES, "roll zeroed on the table instead of level", zero),)
