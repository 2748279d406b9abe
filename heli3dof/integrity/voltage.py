"""Check voltages: unit, sign, the amplifier's limit, and agreement with the commanded voltages.

Voltages beyond the amplifier's limit ±v_max have one of two causes:

* The log contains the controller's output before the limiter. In this case
  `heli3dof.recording.logs.corrections` limits the logged voltages to ±v_max.
* v_max in the profile is too low, and the motors received these voltages.

If more than the share `DIFFERS` of the rows is beyond the limit, the check examines the motion. It
assumes the second cause if the logged voltages explain the motion better than the limited voltages
(`explains_better`). In all other cases it assumes the first cause.

h is the mean voltage per motor in flight, corrected for roll and pitch, and divided by the
profile's hover voltage V_o (`View.hover_ratio`). It is 0.5 … 2 even on rigs that differ from their
profile. If |h| is below `ANOTHER_UNIT`, the voltages have another unit, one of them has the wrong
sign, or the hover voltage was subtracted.

**Hover voltage subtracted.** In flight, the thrust carries the weight, so the true voltages have a
mean near V_o. If a program logs deviations from hover, its voltages lack this mean, and h is near
0. Two tests distinguish this from another unit. They use the responses g of the axes: g is the
acceleration that the voltages cause, divided by the profile's prediction (`response`). K is the
median g of roll and pitch. A subtracted mean does not change K, because roll and pitch respond to
the changes of the voltages.

* The test of yaw needs |h| < `NEAR_ZERO`. Yaw's torque is proportional to sin p (pitch p) times the
  voltage sum. The check adds V_o to both voltages and then estimates yaw's g. If V_o was
  subtracted, the expected g is K. Otherwise it is K h/(1 + h), which is below K/4. So V_o was
  subtracted if g > K/2.
* The second test is used if yaw moves too little. It needs |h| < `ANOTHER_UNIT`. If V_o was
  subtracted, the logged changes are in volts, and the expected K is 1. In another unit, V_o is
  logged as h V_o. All logged voltages are then h times the true ones, and the expected K is 1/h. So
  V_o was subtracted if K < 1/√|h|, the geometric mean of 1 and 1/|h|.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from heli3dof.axes import MOTORS
from heli3dof.errors import RecordingError
from heli3dof.integrity.base import Check, Fault, Kind, Stage, bad_data_fault
from heli3dof.integrity.remedies import voltage_remedy
from heli3dof.integrity.response import Response
from heli3dof.integrity.view import View
from heli3dof.model.control.unexplained_share import AT_LIMIT
from heli3dof.recording.logs import log_validation
from heli3dof.recording.logs.corrections import limited

BEYOND = 1.02
"""Largest ratio of a voltage to v_max. Chosen, as are all constants below."""
ANOTHER_UNIT = 0.15
NEAR_ZERO = 0.3
"""Largest |h| of voltages less the profile's V_o: the hover voltages of real rigs are 0.86 … 1.25
times their profile's"""
SURE, EXPLAINED = 6.0, 0.5
"""Of a reliable response: least standard deviations from zero, least R²"""
OPPOSED = 0.4
"""Half the difference of the motors' mean voltages, divided by V_o: above it, one sign is wrong"""
CLIPPED = 0.02
"""Share of the flight at the limit above which a note reports it"""
FLAT = 0.005
"""Share of rows at the largest voltage, above which this voltage counts as a limit"""
DIFFERS_V, DIFFERS = 0.02, 0.01
"""V: largest difference of command and voltage; largest share of rows beyond it, or beyond v_max"""
BETTER, WORSE = 0.7, 1.05
"""Limits of `explains_better`: largest product of ρ over the axes, largest ρ of an axis. Dry
friction on one axis shifts its ρ by 0.25 on a real rig."""


def limit(view: View) -> Iterable[Fault]:
    """Yield a fault if voltages are missing, in another unit, or beyond the amplifier's limit."""
    r = view.recording
    v, v_max = r.voltage, r.profile.motor.v_max
    if not np.isfinite(v).any(axis=0).all():
        yield Fault(
            "voltage.limit", Kind.BAD_DATA, r.name,
            f"{r.name} has no voltage of at least one motor.",
            "the device does not report its output voltage, or the column was not logged.",
            "log v_front_V and v_back_V, the voltages at the amplifier",
        )  # fmt: skip
        return
    front, back = np.nan_to_num(v).T
    try:
        log_validation.check_voltages(r.name, front, back, v_max)
    except RecordingError as error:
        yield bad_data_fault("voltage.limit", view, error)
        return
    rows = (np.abs(v) > BEYOND * v_max).any(axis=1)
    if not rows.any():
        return
    top, h = float(np.nanmax(np.abs(v))), view.hover_ratio
    exceeds = (
        f"{r.name}: the voltage reaches {top:.4g} V and exceeds the profile's ±{v_max:.4g} V in "
        f"{100 * rows.mean():.3g} % of the rows"
    )
    if top < 100.5 and h is not None and 0.8 < h * v_max / 100 < 1.25:
        yield Fault(
            "voltage.limit", Kind.BAD_DATA, r.name, f"{exceeds}.",
            "per cent of the limit instead of volts.",
            voltage_remedy(r, f"{v_max / 100:.4g}*{{f}}", f"{v_max / 100:.4g}*{{b}}"),
        )  # fmt: skip
    elif rows.mean() > DIFFERS and explains_better(
        view.responses, view.responses_to(limited(view.recording))
    ):
        yield Fault(
            "voltage.limit", Kind.BAD_DATA, r.name,
            f"{exceeds}, and the motion shows that it reached the motors.",
            "motor.v_max belongs to another amplifier, or the voltages have another unit.",
            "correct motor.v_max in the profile, or convert the voltages to volts",
        )  # fmt: skip
    else:
        yield Fault(
            "voltage.limit", Kind.NOTE, r.name,
            f"{exceeds}. Identification and diagnosis limit it to ±{v_max:.4g} V.",
            "the log contains the controller's output before the limiter.",
            "if the amplifier's limit is higher, correct motor.v_max",
        )  # fmt: skip


def explains_better(a: dict[str, Response], b: dict[str, Response]) -> bool:
    """Return True if the voltages behind ``a`` explain the motion better than those behind ``b``.

    ``a`` and ``b`` contain each axis' response, estimated from one of two versions of the voltages.
    1 − R² is the share of the motion that a response does not explain (R²: `Response.explained`).
    An axis without a response has the share 1. ρ is an axis' share in ``a``, divided by its share
    in ``b``. The product of ρ over the axes must be below `BETTER`, and the largest ρ below
    `WORSE`.
    """
    ratios = [_unexplained(a.get(axis)) / _unexplained(b.get(axis)) for axis in {*a, *b}]
    return float(np.prod(ratios)) < BETTER and max(ratios, default=0.0) < WORSE


def _unexplained(response: Response | None) -> float:
    return 1.0 if response is None else 1 - response.explained


def unit(view: View) -> Iterable[Fault]:
    """Yield a fault if the mean voltage in flight is near zero, instead of near the hover voltage.

    The cause is the wrong sign of one motor's voltage, a subtracted hover voltage or another unit.
    """
    r, h = view.recording, view.hover_ratio
    if h is None or abs(h) >= NEAR_ZERO:
        return
    v_max, V_o = r.profile.motor.v_max, r.profile.motor.V_o
    mean = np.mean(r.voltage[view.flying], axis=0)
    if (
        abs(h) < ANOTHER_UNIT
        and abs(mean[0] - mean[1]) / 2 > OPPOSED * abs(V_o)
        and mean[0] * mean[1] < 0
    ):
        other = MOTORS[int(np.argmin(mean * np.sign(V_o)))]
        yield Fault(
            "voltage.sign", Kind.BAD_DATA, r.name,
            f"{r.name}: the rig flies with {mean[0]:+.3g} V on the front motor and "
            f"{mean[1]:+.3g} V on the back one: one lifts, the other pushes down.",
            f"the {other} motor's voltage is logged with the wrong sign (the motor is wired or "
            "mounted the other way round).",
            voltage_remedy(r, front="-{f}") if other == "front" else
            voltage_remedy(r, back="-{b}"), confidence=0.99,
        )  # fmt: skip
        return
    if _is_subtracted(view, h):
        yield Fault(
            "voltage.unit", Kind.BAD_DATA, r.name,
            f"{r.name}: in the air, the motors' mean voltage is {h * V_o:+.3g} V; the profile's "
            f"hover voltage is {V_o:.3g} V. But the axes respond to the changes as in volts.",
            "the hover voltage was subtracted: the log contains deviations from hover.",
            voltage_remedy(r, f"{{f}}+{V_o:.4g}", f"{{b}}+{V_o:.4g}"), confidence=0.99,
        )  # fmt: skip
        return
    if not 0 <= h < ANOTHER_UNIT:
        return
    share = float(np.nanmax(np.abs(r.voltage))) <= 1.02
    yield Fault(
        "voltage.unit", Kind.BAD_DATA, r.name,
        f"{r.name}: the rig hovers at {h * V_o:.3g} V per motor, the profile's at {V_o:.3g} V.",
        "fractions of the limit (−1 … 1) instead of volts." if share else
        "kilovolts, DAC fractions or another unit instead of volts.",
        voltage_remedy(r, f"{v_max:.4g}*{{f}}", f"{v_max:.4g}*{{b}}") if share else
        "convert the voltages to volts",
    )  # fmt: skip


def _is_subtracted(view: View, h: float) -> bool:
    """Return True if the logged voltages are deviations from the hover voltage.

    ``h``: mean voltage in flight, divided by the profile's hover voltage. The module's docstring
    explains the two tests.
    """
    r = view.recording
    known = [x for a, x in view.responses.items() if a != "yaw" and _is_reliable(x)]
    if not known:
        return False
    K = float(np.median([x.gain for x in known]))
    yaw = view.responses_to(replace(r, voltage=r.voltage + r.profile.motor.V_o)).get("yaw")
    if yaw is not None and _is_reliable(yaw):
        return yaw.gain > K / 2
    return abs(h) < ANOTHER_UNIT and K**2 * abs(h) < 1


def _is_reliable(x: Response) -> bool:
    return x.t > SURE and x.explained > EXPLAINED


def clipped(view: View) -> Iterable[Fault]:
    """Yield a note if voltages are often at the limit, or saturate below the profile's limit."""
    r, rows = view.recording, view.flying
    v_max = r.profile.motor.v_max
    at_limit = view.clipped & rows
    if rows.any() and at_limit.sum() > CLIPPED * rows.sum():
        yield Fault(
            "voltage.clipped", Kind.NOTE, r.name,
            f"{r.name}: {100 * at_limit.sum() / rows.sum():.3g} % of the flight is at the "
            f"amplifier's limit of ±{v_max:.4g} V, where the loop is open.",
            "the steps are too large or the gains too high for this amplifier.",
            "use smaller steps or a slower reference: heli3dof run-step --roll 5",
        )  # fmt: skip
    v = r.voltage[view.finite_rows]
    if len(v) < 100 or len(np.unique(v)) < 50:
        return
    top = float(np.abs(v).max())
    flat = np.isclose(np.abs(v), top, rtol=1e-6).any(axis=1)
    if top < AT_LIMIT * v_max and flat.sum() > 20 and flat.mean() > FLAT:
        yield Fault(
            "voltage.clipped", Kind.NOTE, r.name,
            f"{r.name}: the voltage saturates at ±{top:.4g} V in {100 * flat.mean():.3g} % of the "
            f"rows; the profile's limit is ±{v_max:.4g} V.",
            "another limiter, in the DAC or in the controller.",
            f"set motor.v_max = {top:.4g} in the profile if that is the amplifier's",
        )  # fmt: skip


def commanded(view: View) -> Iterable[Fault]:
    """Yield a fault if recorded voltages below the limit differ from the commanded ones."""
    r = view.recording
    cmd, v = r.voltage_cmd, r.voltage
    phase = r.channels.get("phase")
    rows = np.isfinite(cmd).all(axis=1) & view.finite_rows
    rows &= (np.abs(cmd) < AT_LIMIT * r.profile.motor.v_max).all(axis=1)
    rows &= (np.abs(v) < AT_LIMIT * r.profile.motor.v_max).all(axis=1)
    if phase is not None:
        rows &= np.asarray(phase) == 0
    if rows.sum() < 100 or not np.abs(v[rows]).max() > 0:
        return  # motors off: `nothing` reports it
    x, y = cmd[rows].ravel(), v[rows].ravel()
    off = (np.abs(v - cmd) > DIFFERS_V + 1e-3 * np.abs(cmd)).any(axis=1) & rows
    share = float(off.sum() / rows.sum())
    if share < DIFFERS:
        return
    factor = float(x @ y / (x @ x)) if (x @ x) > 0 else 1.0
    spread = float(np.std(y))
    if abs(factor - 1) > 0.05 and np.std(y - factor * x) < 0.05 * max(spread, 1e-9):
        yield Fault(
            "voltage.commanded", Kind.BAD_DATA, r.name,
            f"{r.name}: the voltage is {factor:.4g} times the command, even below the limit.",
            "one of them was logged before, the other behind the amplifier's gain.",
            "log both at the same point, or divide by the amplifier's gain; then check motor.K_f",
            confidence=0.99,
        )  # fmt: skip
        return
    both = rows[1:] & rows[:-1]
    one_row_off = np.abs(v[1:] - cmd[:-1])[both].max(axis=1) > DIFFERS_V
    late = both.sum() >= 100 and float(one_row_off.mean()) < DIFFERS
    yield Fault(
        "voltage.commanded", Kind.NOTE, r.name,
        f"{r.name}: below the limit, the amplifier's voltage differs from the command in "
        f"{100 * share:.3g} % of the rows"
        + (": it is the previous row's command." if late else ".")
        + " The models use the amplifier's voltage.",
        "the log pairs a sample with the voltage held until then." if late else
        "a slew-rate limit, a watchdog, lost commands, or noise of a measured voltage.",
        "",
    )  # fmt: skip


CHECKS = (
    Check("voltage.limit", Stage.VALUES, "voltage missing, or beyond the amplifier's limit", limit),
    Check(
        "voltage.unit",
        Stage.MOTION,
        "hover voltage in another unit, or subtracted",
        unit,
        ("voltage.unit", "voltage.sign"),
    ),
    Check("voltage.clipped", Stage.MOTION, "share of the flight at the voltage limit", clipped),
    Check("voltage.commanded", Stage.VALUES, "voltage unlike its command", commanded),
)
