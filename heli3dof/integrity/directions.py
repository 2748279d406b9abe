"""Report wrong signs of encoders and voltages, and swapped motors.

The front and back voltages have the sum S and the difference D. The profile predicts accelerations
u_r ∝ S of roll, u_p ∝ D of pitch p and u_ψ ∝ −sin p S of yaw. The measured accelerations are g u,
with g = 1 on a rig like its profile (`response`). V_o is the hover voltage in the profile. h is the
hover voltage in flight, divided by V_o (`View.hover_ratio`).

    roll's sign wrong        g_r < 0
    pitch's sign wrong       g_p < 0 and g_ψ < 0     (sin p has the wrong sign too)
    front and back swapped   g_p < 0 and g_ψ > 0     (D has the wrong sign, sin p S has not)
    yaw's sign wrong         g_p > 0 and g_ψ < 0     (or motors swapped and pitch's sign wrong)
    voltages' sign wrong     h < −0.3, and g_r < 0 or g_p < 0 (−g then replaces g in the rows above)
    V_o's sign wrong         h < −0.3, and neither g_r nor g_p is negative

The sign of g is *known* if |g| exceeds `SURE` standard deviations, R² of the estimate is at least
`EXPLAINED`, and the predicted accelerations have a standard deviation of at least `DRIVE`. If g_p
is negative and the sign of g_ψ is unknown, two rows of the table fit, and the fault names both
causes. The same applies if g_ψ is negative and the sign of g_p is unknown.

Roll's sign is also wrong if the arm starts on the table and roll falls by more than `SINKS`.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from heli3dof.axes import AXES, ROLL
from heli3dof.integrity.base import Check, Fault, Kind, Stage
from heli3dof.integrity.remedies import angle_remedy
from heli3dof.integrity.response import Response
from heli3dof.integrity.view import View
from heli3dof.model.estimation.filter_data import ON_TABLE_BELOW
from heli3dof.recording.recording import Recording

SURE, EXPLAINED, DRIVE = 6.0, 0.5, 0.02
"""Least values for a known sign of g. Chosen, as are all constants below; `DRIVE` in rad/s²."""
SINKS = np.radians(2.5)
"""rad: roll this far below its start would be in the table."""
BEYOND_REACH = np.radians(60.0)
"""rad: larger roll angles are impossible."""


def sign(response: Response | None) -> int:
    """Return the sign (±1) of an axis' response g to the voltages, or 0 if the sign is not known.

    The sign is known if |g| exceeds `SURE` standard deviations, R² of the estimate is at least
    `EXPLAINED`, and the predicted accelerations have a standard deviation of at least `DRIVE`.
    """
    if response is None or response.explained < EXPLAINED or response.drive < DRIVE:
        return 0
    return int(np.sign(response.t)) if abs(response.t) > SURE else 0


def directions(view: View) -> Iterable[Fault]:
    r, h = view.recording, view.hover_ratio
    s = {a: sign(view.responses.get(a)) for a in AXES}
    if h is not None and h < -0.3:
        V_o = r.profile.motor.V_o
        v_o_wrong = s["roll"] >= 0 and s["pitch"] >= 0
        yield _fault(
            view, "voltage.sign", None,
            f"{r.name}: the rig hovers at {h * V_o:.3g} V per motor, the profile's at {V_o:.3g} V.",
            "the profile's V_o has the wrong sign: every axis responds in the right direction "
            "(the paper's Table I has the wrong sign of T_g)."
            if v_o_wrong
            else "the voltages are logged with the wrong sign.",
            f"set motor.V_o = {h * V_o:.3g}" if v_o_wrong else "change the sign of both voltages",
        )  # fmt: skip
        if not v_o_wrong:
            s = {a: -x for a, x in s.items()}
    roll = _roll_evidence(view, s["roll"])
    if roll:
        yield _fault(
            view, "encoder.sign", "roll", f"{r.name}: {roll}.", "the encoder's sign is wrong.",
            _sign_fix(r, "roll"),
        )  # fmt: skip
    gains = {a: f"{x.gain:+.2g} ± {x.std:.1g}" for a, x in view.responses.items()}
    p, y = s["pitch"], s["yaw"]
    if ROLL in view.measured and np.nanmax(r.angle[:, ROLL]) > BEYOND_REACH:
        y = 0  # cos r is wrong, and therefore also u_ψ
    if p < 0 < y:
        yield _fault(
            view, "motors.swapped", None,
            f"{r.name}: pitch responds to the voltage difference in the wrong direction "
            f"({gains['pitch']} times the profile's), but yaw to the tilt in the right one "
            f"({gains['yaw']}).",
            "front and back are swapped, at the amplifier or in the log.",
            "swap v_front_V and v_back_V, or the two motors' cables",
        )  # fmt: skip
    elif p < 0:
        both = y == 0
        yield _fault(
            view, "encoder.sign", "pitch",
            f"{r.name}: pitch responds to the voltage difference in the wrong direction "
            f"({gains['pitch']} times the profile's)"
            + ("." if both else f", and so does yaw to the tilt ({gains['yaw']})."),
            "the encoder's sign is wrong, or front and back are swapped; yaw moves too little to "
            "decide." if both else "the encoder's sign is wrong.",
            _sign_fix(r, "pitch"), 0.5 if both else 0.99,
        )  # fmt: skip
    elif y < 0:
        both = p == 0
        yield _fault(
            view, "encoder.sign", "yaw",
            f"{r.name}: yaw turns against the tilt of the thrust ({gains['yaw']} times the "
            "profile's).",
            "the encoder's sign is wrong" + (", or pitch's is." if both else
            "; or pitch's is, and front and back are swapped too (the rig's mirror image)."),
            _sign_fix(r, "yaw"), 0.5 if both else 0.99,
        )  # fmt: skip


def _roll_evidence(view: View, sign_of_response: int) -> str:
    """Return the evidence that roll's sign is wrong, as text; empty if there is none."""
    r = view.recording
    if sign_of_response < 0:
        x = view.responses["roll"]
        return (
            f"roll responds to the voltage sum in the wrong direction ({x.gain:+.2g} ± {x.std:.1g} "
            "times the profile's)"
        )
    if ROLL not in view.measured:
        return ""
    roll = r.angle[view.finite_rows, ROLL]
    start = float(np.median(roll[:5]))
    lowest = float(roll.min())
    lifted = np.nanmax(r.voltage.sum(axis=1)) > 2 * abs(r.profile.motor.V_o)
    if start < ON_TABLE_BELOW and lowest < start - SINKS and lifted:
        return (
            f"roll starts at rest at {np.degrees(start):.4g}° and sinks to "
            f"{np.degrees(lowest):.4g}°, into the table"
        )
    return ""


def _sign_fix(r: Recording, axis: str) -> str:
    counts = int(getattr(r.profile.encoder, axis))
    return angle_remedy(r, axis, "-{}", f"encoder.{axis} = {-counts}")


def _fault(
    view: View, check: str, axis: str | None, sentence: str, cause: str, fix: str,
    confidence: float = 0.99,
) -> Fault:  # fmt: skip
    return Fault(
        check, Kind.BAD_DATA, view.recording.name, sentence, cause, fix, axis=axis,
        confidence=confidence,
    )  # fmt: skip


CHECKS = (
    Check(
        "directions", Stage.MOTION, "an encoder's sign, front and back swapped", directions,
        ("encoder.sign", "motors.swapped", "voltage.sign"),
    ),
)  # fmt: skip
