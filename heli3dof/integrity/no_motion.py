"""Report recordings without usable motion as not identifiable.

The check reports the first of these conditions that holds:

1. No angle was recorded, or no angle changes by `COUNTS` encoder counts.
2. The voltages stay below `OFF` times the amplifier's limit v_max. So the motors did not cause the
   motion.
3. The arm stays on the table: the roll angle starts below `ON_TABLE_BELOW` and does not increase by
   `LIFTED`. If another angle changes by `MOVES`, the check reports condition 3 only as a note (the
   mildest kind of fault), because the recording contains usable motion.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from heli3dof.axes import AXES, ROLL
from heli3dof.integrity.base import Check, Fault, Kind, Stage
from heli3dof.integrity.view import View
from heli3dof.model.estimation.filter_data import ON_TABLE_BELOW
from heli3dof.recording.safety_trip import why_short

OFF = 0.02
"""Share of v_max below which a voltage cannot move the rig"""
COUNTS = 3
LEAST_S = 1.0
"""s: a shorter recording is a fragment."""
LIFTED, MOVES = np.radians(1.0), np.radians(2.0)
"""rad: least rise of roll, least motion of another axis. Chosen, as are all limits here."""


def nothing(view: View) -> Iterable[Fault]:
    r = view.recording
    q = r.angle[view.finite_rows][:, view.measured]
    if not view.measured or not len(q):
        yield Fault(
            "nothing.moves", Kind.NOT_IDENTIFIABLE, r.name, f"{r.name} contains no angle.",
            "no encoder was logged.", "log roll_deg, pitch_deg and yaw_deg",
        )  # fmt: skip
        return
    top = float(np.nanmax(np.abs(r.voltage)))
    span = np.ptp(q, axis=0)
    count = np.abs(r.profile.encoder.rad_per_count)[view.measured]
    if (span < COUNTS * count).all():
        off = top < OFF * r.profile.motor.v_max
        yield Fault(
            "nothing.moves", Kind.NOT_IDENTIFIABLE, r.name,
            f"{r.name}: no angle moves by {COUNTS} counts or more in {r.duration:.3g} s; the "
            f"voltage reaches {top:.3g} V.",
            *why_short(
                [r],
                "the recording is a fragment." if r.duration < LEAST_S else
                "the motors were off." if off else
                "the amplifier was not enabled, its supply is off, or the rig is clamped.",
                "heli3dof run-step --roll 5" if off or r.duration < LEAST_S else
                "switch the amplifier on, free the arm, then heli3dof run-step --roll 5",
            ),
            confidence=1.0,
        )  # fmt: skip
    elif top < OFF * r.profile.motor.v_max:
        yield Fault(
            "nothing.moves", Kind.NOT_IDENTIFIABLE, r.name,
            f"{r.name}: the voltage stays within ±{top:.3g} V, too little to cause the motion.",
            "the motors were off (a coast-down, or the rig was moved by hand).",
            "add a flight with the motors on: heli3dof run rich",
        )  # fmt: skip
    elif ROLL in view.measured:
        roll = r.angle[view.finite_rows, ROLL]
        rest = float(np.median(roll[:5]))
        if rest < ON_TABLE_BELOW and roll.max() < rest + LIFTED:
            still = all(s < MOVES for s, i in zip(span, view.measured, strict=True) if i != ROLL)
            names = " and ".join(AXES[i] for i in view.measured if i != ROLL)
            yield Fault(
                "nothing.flies", Kind.NOT_IDENTIFIABLE if still else Kind.NOTE, r.name,
                f"{r.name}: the arm never leaves the table ({np.degrees(rest):.4g}°)"
                + (f"; {names} move." if not still else "."),
                *why_short(
                    [r],
                    f"the voltage (at most {top:.3g} V) does not lift it, the amplifier is off, or "
                    "roll's encoder is not connected.",
                    "check the amplifier and roll's encoder, then heli3dof run-step --roll 5",
                ),
            )  # fmt: skip


CHECKS = (
    Check(
        "nothing.moves", Stage.MOTION, "motors off, no motion, arm never off the table", nothing,
        ("nothing.moves", "nothing.flies"),
    ),
)  # fmt: skip
