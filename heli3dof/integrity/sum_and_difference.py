"""Report a log whose two voltages are the sum and the difference of the motors' voltages.

In level flight each motor carries half of the weight, so their mean voltages (S ± D)/2 are nearly
equal. The mean of the difference D is then small against that of the sum S. If the |mean| of one
column is below `MAX_MEAN_RATIO` times that of the other one, the motion decides. The check reports
sum and difference if all of these hold:

- The voltages (S + D)/2 and (S − D)/2 explain the motion better than the logged ones
  (`explains_better`).
- Pitch has a response to them.
- The motion does not show two swapped columns (`columns`).

D is assumed to be front − back. If pitch then responds with the wrong sign and yaw does not, D is
back − front. If both respond with the wrong sign, `directions` reports pitch's sign.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from heli3dof.axes import MOTORS
from heli3dof.integrity.base import Check, Fault, Kind, Stage
from heli3dof.integrity.columns import swap_by_motion
from heli3dof.integrity.directions import sign
from heli3dof.integrity.remedies import voltage_remedy
from heli3dof.integrity.view import View
from heli3dof.integrity.voltage import explains_better

LEAST_S = 2.0
"""s: shortest time in the air that gives a mean. Chosen."""
MAX_MEAN_RATIO = 0.4
"""Largest ratio of the difference's mean to the sum's. Chosen."""


def sum_and_difference(view: View) -> Iterable[Fault]:
    r, rows = view.recording, view.airborne & view.finite_rows
    if rows.sum() * r.dt < LEAST_S:
        return
    mean = r.voltage[rows].mean(axis=0)
    i = int(np.argmax(np.abs(mean)))
    if abs(mean[1 - i]) >= MAX_MEAN_RATIO * abs(mean[i]):
        return
    S, D = r.voltage[:, i], r.voltage[:, 1 - i]
    motors = np.column_stack([S + D, S - D]) / 2
    found = view.responses_to(replace(r, voltage=motors))
    if "pitch" not in found or not explains_better(found, view.responses):
        return
    if swap_by_motion(view) is not None:
        return
    back_minus_front = sign(found["pitch"]) < 0 <= sign(found.get("yaw"))
    total, difference = ("{f}", "{b}") if i == 0 else ("{b}", "{f}")
    plus, minus = f"({total}+{difference})/2", f"({total}-{difference})/2"
    yield Fault(
        "columns.sum_and_difference", Kind.BAD_DATA, r.name,
        f"{r.name}: in the air, v_front_V has a mean of {mean[0]:.3g} V and v_back_V of "
        f"{mean[1]:.3g} V. As sum and difference they leave "
        f"{100 * (1 - found['pitch'].explained):.2g} % of pitch's motion unexplained, as logged "
        + (f"{100 * (1 - view.responses['pitch'].explained):.2g} %."
           if "pitch" in view.responses else "all of it."),
        f"v_{MOTORS[i]}_V is the sum of the motors' voltages, v_{MOTORS[1 - i]}_V their difference "
        + ("back − front." if back_minus_front else "front − back."),
        voltage_remedy(r, *((minus, plus) if back_minus_front else (plus, minus))),
        confidence=0.99,
    )  # fmt: skip


CHECKS = (
    Check(
        "columns.sum_and_difference", Stage.COLUMNS, "sum and difference of the voltages",
        sum_and_difference,
    ),
)  # fmt: skip
