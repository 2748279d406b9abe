"""Report an encoder that stays on one count while its axis must move.

Dry friction or backlash may hold an axis, so the axis must have stayed on the count for `LEAST_S`.
The voltages cause the torque J u: J is the inertia, u (rad/s²) the acceleration that the profile
predicts (`response`). Constant torques are unknown. With u smoothed over `SMOOTH_S`, the axis must
therefore move if ½ (max J u − min J u) > `HOLDS_NM` while it stays on the count.

On the table, roll r can only rise. It must move if r̈ = u − T_g cos r/J, integrated twice with
ṙ ≥ 0, exceeds `RISEN` (T_g: gravity torque, N·m). Rows at a stop, with the motors off or in the
final voltage ramp are left out.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from heli3dof.axes import AXES, PITCH, ROLL
from heli3dof.identification.row_selection import STOP_BEYOND
from heli3dof.integrity.base import Check, Fault, Kind, Stage
from heli3dof.integrity.response import predicted_accelerations
from heli3dof.integrity.view import View
from heli3dof.model.estimation.filter_data import ON_TABLE_BELOW

LEAST_S = 2.5
"""s: least time on one count. Chosen, as are all constants below."""
SMOOTH_S = 0.5
HOLDS_NM = np.array([0.4, 0.04, 0.2])
"""N·m that friction may hold, by axis. A real rig's roll stuck for 1.3 s against ±0.25 N·m."""
RISEN = np.radians(25.0)
CHECK_BY_HAND = (
    "switch the amplifier off; heli3dof monitor, and turn {} by hand: does its angle follow?"
)
LEFT_OUT = ("unread", "motors_off", "ramp_down")


def still_intervals(view: View, axis: int) -> list[tuple[int, int]]:
    """Return the intervals (first row, last row + 1) in which the axis stays on one count.

    They last at least `LEAST_S`.
    """
    r = view.recording
    q = r.angle[:, axis]
    out = np.logical_or.reduce([view.unusable[k] for k in LEFT_OUT])
    same = np.concatenate([[False], np.diff(q) == 0]) & ~out
    edges = np.flatnonzero(np.diff(np.concatenate([[0], same.astype(int), [0]])))
    long = LEAST_S / r.dt
    return [
        (max(int(a) - 1, 0), int(b))
        for a, b in zip(edges[::2], edges[1::2], strict=True)
        if b - a >= long
    ]


def frozen(view: View) -> Iterable[Fault]:
    r = view.recording
    angle, voltage = np.nan_to_num(r.angle), np.nan_to_num(r.voltage)
    u = predicted_accelerations(angle, voltage, r.profile)
    J = np.array(r.profile.inertias)
    if (np.ptp(r.angle[view.finite_rows][:, view.measured], axis=0) == 0).all():
        return  # `nothing` reports that no axis moves
    for i in view.measured:
        intervals = still_intervals(view, i)
        proven = [(a, b, text) for a, b in intervals if (text := _evidence(view, i, a, b, u, J))]
        if not proven:
            if np.ptp(r.angle[view.finite_rows, i]) == 0 and view.airborne.any():
                yield Fault(
                    "encoder.frozen", Kind.NOTE, r.name,
                    f"{r.name}: {AXES[i]} never changes by a count. Its voltages are too small to "
                    "decide whether it should move.",
                    "the axis is clamped or held by friction, or its encoder is not connected.",
                    CHECK_BY_HAND.format(AXES[i]), axis=AXES[i], confidence=0.5,
                )  # fmt: skip
            continue
        a, b, evidence = max(proven, key=lambda x: x[1] - x[0])
        whole = b - a > 0.98 * len(r)
        to_the_end = b >= len(r) - 1 - 4 / r.dt and not whole
        span = (
            "throughout" if whole else
            f"from {r.t[a]:.3g} s {'on' if to_the_end else f'to {r.t[b - 1]:.3g} s'}"
        )  # fmt: skip
        yield Fault(
            "encoder.frozen", Kind.BAD_DATA, r.name,
            f"{r.name}: {AXES[i]} stays on one count ({np.degrees(r.angle[a, i]):.4g}°) {span}, "
            f"{evidence}.",
            "the encoder's cable or its input on the card; or the axis is clamped, or rests at a "
            "stop that a wrong scale or offset hides.",
            f"{CHECK_BY_HAND.format(AXES[i])} Then record again"
            if whole or a < 5 / r.dt else
            f"use the data before: recording.between(0, {r.t[a]:.3g}); check the encoder's cable",
            axis=AXES[i], confidence=0.99,
        )  # fmt: skip


def _evidence(view: View, i: int, a: int, b: int, u: np.ndarray, J: np.ndarray) -> str:
    """Return how rows a to b − 1 show that axis ``i`` must have moved; empty if they do not."""
    r = view.recording
    q = float(r.angle[a, i])
    if (i == ROLL and q > STOP_BEYOND) or (i == PITCH and abs(q) > STOP_BEYOND):
        return ""
    on_table = i == ROLL and q < ON_TABLE_BELOW and q <= np.nanmin(r.angle[:, ROLL]) + 1e-9
    if on_table:
        T_g = r.profile.trim_torque
        acceleration = u[a:b, ROLL] - T_g * np.cos(q) / J[ROLL]
        rate, rise, dt = 0.0, 0.0, r.dt
        for x in acceleration.tolist():
            rate = max(0.0, rate + x * dt)
            rise += rate * dt
        if rise < RISEN:
            return ""
        return "although its voltages would have lifted it off the table"
    width = max(1, round(SMOOTH_S / r.dt))
    if b - a < 2 * width:
        return ""
    smooth = np.convolve(u[a:b, i], np.ones(width) / width, "valid")
    half_range = float(np.ptp(smooth)) / 2 * J[i]
    if half_range < HOLDS_NM[i]:
        return ""
    return f"although the voltages' torque on it varies by ±{half_range:.2g} N·m"


CHECKS = (
    Check("encoder.frozen", Stage.MOTION, "an axis that must move stays on one count", frozen),
)
