"""Open the control loops of some axes during a flight: freeze their contributions to the voltage.

The voltage that `control_law` computes is a sum of contributions of each axis i to motor m,

    c_im = K_mi (q_i,ref − q_i) − K_m,3+i q̇_i + clamp(K_m,6+j ξ_j)

with the gain K (2 × 8), the angle q_i, its reference q_i,ref, its filtered rate q̇_i and the error
integral ξ_j. j = 0 is roll and j = 1 yaw; pitch has no integral.

Each axis has a mode in each control period:

    CLOSED  unchanged
    LEARN   unchanged; the mean c̄_im over consecutive LEARN periods is stored as trim voltage
            (the axis' next LEARN in the flight replaces it)
    OPEN    c_im is replaced by c̄_im, so the voltage does not depend on the axis

For each motor m, the replacement is an extra voltage Σ_i (c̄_im − c_im) over the open axes.
The reference of an open axis is its own angle, so its integral does not grow. When the loop closes,
the reference returns to the flight plan's reference at the rate `RETURN`, without a jump. A
recording contains the references and extra voltages as changed here. So V = law(angle, reference) +
extra is true for its rows, and a replay needs no modes.

The built-in plans open roll or yaw and keep pitch closed. With an open pitch loop, 1 % of mismatch
between the motors would tip over a body without pitch stiffness in seconds. If an angle or rate
exceeds `SHARE` of the safety envelope, all loops are closed. They stay closed until a period in
which no axis has the mode OPEN.
"""

from __future__ import annotations

from collections.abc import MutableSequence, Sequence
from math import radians
from typing import Any

import numpy as np

from heli3dof.model.base import LoopTask
from heli3dof.model.control.controller import (
    _CLAMP,
    _DT,
    _GOOD,
    _K,
    _LIMITED,
    _RATE,
    _V_MAX,
    _XI,
    Controller,
    control_law,
)
from heli3dof.rig.profile import ControllerSpec, Limits

CLOSED, LEARN, OPEN = 0, 1, 2
SHARE = 0.7
"""Share of the safety envelope's half width that angles and rates may reach with an open loop"""
RETURN = radians(10.0)
"""rad/s: rate at which the reference returns to the plan's after a loop was closed"""
FADE_S = 0.03
"""s: time constant of the decay of the replacement voltage once all loops are closed"""
_SUM, _COUNT, _BEFORE, _OUTSIDE, _OPEN, _XI_BEFORE = 0, 6, 9, 12, 13, 14
_EXCITATION, _OFFSET, _HELD, _FADING = 16, 18, 21, 24
N_OPENING = 26


def open_loop_bounds(limits: Limits) -> list[float]:
    """Return the bounds within which a loop may be open: `SHARE` of the safety envelope ``limits``.

    The list is [roll low, roll high, |pitch|, |yaw|, |roll rate|, |pitch rate|, |yaw rate|] in rad
    and rad/s.
    """
    middle = (limits.roll_max_deg + limits.roll_min_deg) / 2
    half = SHARE * (limits.roll_max_deg - limits.roll_min_deg) / 2
    rest = (limits.pitch_max_deg, limits.yaw_max_deg, *limits.rates_deg_per_s)
    return [radians(v) for v in (middle - half, middle + half, *(SHARE * r for r in rest))]


def opening(task: LoopTask) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the arguments (mode, bounds, z) of `before_law` for a simulation of ``task``.

    ``mode``: the axes' modes in the N control periods (N, 3), or (0, 3) if the task opens no loop.
    ``bounds``: `open_loop_bounds`. ``z``: the initial state, `N_OPENING` zeros.
    """
    modes = np.zeros((0, 3), dtype=np.int8) if task.opened is None else task.opened
    return (
        np.ascontiguousarray(modes, dtype=np.int8),
        np.array(open_loop_bounds(task.limits)),
        np.zeros(N_OPENING),
    )


def before_law(
    p: Sequence[float],
    s: Sequence[float],
    bounds: Sequence[float],
    z: MutableSequence[float],
    mode: Sequence[int],
    angle: Sequence[float],
    reference: MutableSequence[float],
    extra: MutableSequence[float],
) -> None:
    """Decide which axes run in open loop in a control period; set references for `control_law`.

    ``mode`` (3) is the request for each axis: 0 CLOSED; 1 LEARN: closed, while `after_law` averages
    the axis's contribution to the voltage; 2 OPEN. If an angle or rate is outside ``bounds``
    (`open_loop_bounds`), all loops are closed. They stay closed until a period in which no axis has
    the mode OPEN.

    ``p``, ``s``: parameters and state of `control_law`; ``angle`` (3) rad: measured; ``z``: state
    of the loop opening, `N_OPENING` zeros at the start. ``reference`` (3) rad is overwritten with
    the references to apply. ``extra`` (2) V, the excitation, is moved to ``z``, where `after_law`
    reads it. `before_law` and `after_law` run on Python lists and under ``numba.njit`` on float64
    arrays.
    """
    any_open = False
    for i in range(3):
        if mode[i] == 1 and z[_BEFORE + i] != 1.0:
            z[_COUNT + i] = z[_SUM + 2 * i] = z[_SUM + 2 * i + 1] = 0.0
        z[_BEFORE + i] = mode[i]
        any_open = any_open or mode[i] == 2
    inside = bounds[0] <= angle[0] <= bounds[1]
    for i in range(3):
        inside = inside and (i == 0 or abs(angle[i]) <= bounds[1 + i])
        inside = inside and abs(s[_RATE + i]) <= bounds[4 + i]
    if not any_open:
        z[_OUTSIDE] = 0.0
    elif not inside:
        z[_OUTSIDE] = 1.0
    z[_OPEN] = 1.0 if any_open and z[_OUTSIDE] == 0.0 else 0.0
    for i in range(3):
        if mode[i] == 2 and z[_OPEN] == 1.0:
            reference[i] = angle[i]
            z[_HELD + i] = 1.0
        else:
            if z[_HELD + i] == 1.0:
                z[_OFFSET + i] = angle[i] - reference[i]
                z[_HELD + i] = 0.0
            step, offset = RETURN * p[_DT], z[_OFFSET + i]
            z[_OFFSET + i] = min(max(0.0, offset - step), offset + step)
            reference[i] += z[_OFFSET + i]
    for i in range(2):
        z[_XI_BEFORE + i] = s[_XI + i]
        z[_EXCITATION + i] = extra[i] if extra[i] == extra[i] else 0.0
        extra[i] = 0.0


def after_law(
    p: Sequence[float],
    s: Sequence[float],
    z: MutableSequence[float],
    mode: Sequence[int],
    extra: MutableSequence[float],
    out: MutableSequence[float],
) -> None:
    """Average or replace the axes' contributions to the voltages that `control_law` computed.

    In mode LEARN the contribution is averaged; in an open loop the average replaces it. Once all
    loops are closed, the replacement voltage decays with the time constant `FADE_S`. Finally,
    the excitation is added. ``extra`` (2) V and the law's output ``out`` (4) V are overwritten with
    the values to apply. ``p``, ``s``: the law's parameters and state; ``z``: state of the loop
    opening; ``mode``: see `before_law`.
    """
    for m in range(2):
        replaced = 0.0
        for i in range(3):
            if mode[i] == 0 or (mode[i] == 2 and z[_OPEN] == 0.0):
                continue
            k = _K + 8 * m
            c = p[k + i] * (s[_LIMITED + i] - s[_GOOD + i]) - p[k + 3 + i] * s[_RATE + i]
            if i != 1:
                j = i // 2
                c += min(max(p[k + 6 + j] * z[_XI_BEFORE + j], -p[_CLAMP]), p[_CLAMP])
            if mode[i] == 1:
                z[_SUM + 2 * i + m] += c
                z[_COUNT + i] += 0.5
            else:
                replaced += z[_SUM + 2 * i + m] / max(z[_COUNT + i], 1.0) - c
        if z[_OPEN] == 0.0:
            replaced = z[_FADING + m] * max(0.0, 1.0 - p[_DT] / FADE_S)
            if abs(replaced) < 1e-3:
                replaced = 0.0
        z[_FADING + m] = replaced
        extra[m] = z[_EXCITATION + m] + replaced
        v = out[m] + extra[m]
        out[m] = v
        if v - v != 0.0:  # NaN or infinite
            v = 0.0
        out[2 + m] = min(max(v, -p[_V_MAX]), p[_V_MAX])


class OpenedController(Controller):
    """The default controller in plain Python, which can also open the loops of single axes."""

    def __init__(self, spec: ControllerSpec, V_o: float, v_max: float, dt: float) -> None:
        super().__init__(spec, V_o, v_max, dt)
        self._bounds = open_loop_bounds(Limits())
        self._z = [0.0] * N_OPENING

    @classmethod
    def of(cls, profile: Any) -> OpenedController:
        """Return a `Profile`'s controller.

        It closes all loops when an angle or rate exceeds `SHARE` of the safety limits.
        """
        made = super().of(profile)
        assert isinstance(made, cls)
        made._bounds = open_loop_bounds(profile.limits)
        return made

    def step_opened(
        self,
        mode: Sequence[int],
        angle: Sequence[float],
        reference: Sequence[float],
        extra: Sequence[float],
    ) -> tuple[
        tuple[float, float, float], tuple[float, float], tuple[float, float], tuple[float, float]
    ]:
        """Compute one control period in which the loops of some axes may be open.

        ``mode`` (3): 0 CLOSED, 1 LEARN, 2 OPEN for each axis. Returns reference (3,) rad and extra
        voltage (2,) V as applied, then the motor voltages (2,) V before and after the limiter.
        """
        r, e, out = list(reference), list(extra), self._out
        before_law(self._p, self._s, self._bounds, self._z, mode, angle, r, e)
        control_law(self._p, self._s, angle, r, e, out)
        after_law(self._p, self._s, self._z, mode, e, out)
        return (r[0], r[1], r[2]), (e[0], e[1]), (out[0], out[1]), (out[2], out[3])
