"""The default controller: the paper's eq (7) with its gain (14), sampled, as on the real rig.

::

    V = V_o + K_g [r_ref − r, p_ref − p, ψ_ref − ψ, −ṙ, −ṗ, −ψ̇, ∫(r_ref − r), ∫(ψ_ref − ψ)] + extra
    v = clip(V, ±v_max)

in radians, seconds and volts. The paper's errata E5, E6, E7 (docs/explanation/paper.md) are
corrected.

- V (2,): the motor voltages; v (2,): the same after the limiter
- V_o: the hover voltage
- K_g (2, 8): the gain
- ``extra`` (2,): voltages that are added to the feedback, for example as excitation

At sample k:

1. Each reference passes a rate limiter. After `Controller.reset` it starts at the measured angle.
2. Each rate is the encoder angle filtered by ω² s / (s² + 2 ζ ω s + ω²), discretised by Tustin. The
   profile sets the filter's cut-off frequency ω (rad/s) and damping ζ.
3. ξ_r and ξ_ψ are the integrals of the roll and the yaw error. Their contributions to the voltage
   of motor m are ``K_g[m, 6] ξ_r`` and ``K_g[m, 7] ξ_ψ``. Each contribution is clamped to
   ±``integrator_clamp_V``. An integral stops growing when its contributions to both motors have
   reached the clamp (anti-windup). If both motors have gains of equal size, the contributions leave
   the clamp as soon as the error changes sign.
4. The voltage is computed from sample k's angles and the integrals up to sample k. Then the
   integrals advance by ``dt × error`` (forward Euler).

`control_law` is the only implementation of this law. The real-time loop runs it on Python lists (a
few µs per period, without numba), and the simulations compile it.

A lost angle (NaN) is replaced by the last valid one. A NaN in a reference or in ``extra`` counts as
zero. If the computed voltage is not finite, the output v is 0 V.

**Open loops.** A plan may open the loops of some axes. The controller then replaces the feedback of
these axes by constant voltages. The feedback voltage of motor m is V_o + Σ_i c_im. Axis i (0 roll,
1 pitch, 2 yaw) contributes

    c_im = K_m,i (q_i,ref − q_i) − K_m,3+i q̇_i + clamp(K_m,6+j ξ_j)

K_m,n is an element of K_g. q_i is the angle of the axis, q_i,ref its reference, q̇_i its filtered
rate, and ξ_j the integral of its error. j is 0 for roll and 1 for yaw; pitch has no integral.

Each axis has a mode in each control period:

    CLOSED  The loop is closed.
    LEARN   The loop is closed. The controller computes c̄_im, the mean of c_im over consecutive
            periods with this mode. The first of these periods starts a new mean.
    OPEN    The loop is open. The constant c̄_im replaces c_im: the controller adds c̄_im − c_im to
            ``extra[m]``. The reference of the axis is its own angle, so ξ_j does not grow.

When a loop closes, its reference returns to the plan's reference at the rate `RETURN`, without a
jump. A recording contains ``extra`` and the references after these changes. So the law above holds
for every row, and a replay needs no modes.

The built-in plans open roll or yaw, not pitch. With an open pitch loop, a body without pitch
stiffness would tip over within seconds if the motors' thrusts differed by 1 %. If an angle or a
rate exceeds `SHARE` of the safety envelope, the controller closes all loops. They stay closed until
a period in which no axis has the mode OPEN.
"""

from __future__ import annotations

from collections.abc import MutableSequence, Sequence
from math import radians
from typing import TYPE_CHECKING, Any

import numpy as np

from heli3dof.rig.profile import ControllerSpec, Limits

if TYPE_CHECKING:
    from heli3dof.model.base import LoopTask

# Indices of the flat parameters p, state s and output out of `control_law`.
_DT, _V_O, _V_MAX, _REF_STEP, _CLAMP, _B0, _A1, _A2, _XI_MAX = range(9)
_K = _XI_MAX + 2
_LIMITED, _FILTER, _RATE, _XI, _GOOD = 0, 3, 9, 12, 14
N_STATE = 17
N_OUT = 4  # commanded voltage (front, back), then after the limiter
_LARGEST_ANGLE = 1e6  # rad; a larger reading (infinity, NaN) counts as lost


CLOSED, LEARN, OPEN = 0, 1, 2
SHARE = 0.7
"""Share of the safety envelope's half width that angles and rates may reach with an open loop"""
RETURN = radians(10.0)
"""rad/s: rate at which the reference returns to the plan's after a loop was closed"""
FADE_S = 0.03
"""s: time constant with which the extra voltage of open loops decays once all loops are closed"""
_SUM, _COUNT, _BEFORE, _OUTSIDE, _OPEN, _XI_BEFORE = 0, 6, 9, 12, 13, 14
_EXCITATION, _OFFSET, _HELD, _FADING = 16, 18, 21, 24
N_OPEN_LOOP_STATE = 26


def control_law(
    p: Sequence[float],
    s: MutableSequence[float],
    angle: Sequence[float],
    reference: Sequence[float],
    extra: Sequence[float],
    out: MutableSequence[float],
) -> None:
    """Compute one control period: write the voltages to ``out`` (4) V and update the state ``s``.

    ``p``: parameters, from `parameters`; ``s``: state, from `state_at_rest`; ``angle``,
    ``reference`` (3) rad: measured angles and references; ``extra`` (2) V: excitation. ``out`` gets
    the commanded voltages (front, back), then the same limited to ±v_max. Runs unchanged in Python
    on lists and under ``numba.njit`` on float64 arrays.
    """
    step, b0, a1, a2, clamp = p[_REF_STEP], p[_B0], p[_A1], p[_A2], p[_CLAMP]
    for i in range(3):
        y = angle[i]
        if not abs(y) < _LARGEST_ANGLE:
            y = s[_GOOD + i]
        s[_GOOD + i] = y
        # 1. The rate-limited reference.
        r = reference[i]
        if r != r:
            r = 0.0
        s[_LIMITED + i] += min(max(r - s[_LIMITED + i], -step), step)
        # 2. The rate, by direct form II transposed; the numerator is b0 (1 − z⁻²).
        j = _FILTER + 2 * i
        rate = b0 * y + s[j]
        s[j] = s[j + 1] - a1 * rate
        s[j + 1] = -b0 * y - a2 * rate
        s[_RATE + i] = rate
    e_roll = s[_LIMITED] - s[_GOOD]
    e_pitch = s[_LIMITED + 1] - s[_GOOD + 1]
    e_yaw = s[_LIMITED + 2] - s[_GOOD + 2]
    # 3. The gain, with each integral's contribution clamped.
    for m in range(2):
        k = _K + 8 * m
        v = p[_V_O]
        v += p[k] * e_roll - p[k + 3] * s[_RATE]
        v += p[k + 1] * e_pitch - p[k + 4] * s[_RATE + 1]
        v += p[k + 2] * e_yaw - p[k + 5] * s[_RATE + 2]
        v += min(max(p[k + 6] * s[_XI], -clamp), clamp)
        v += min(max(p[k + 7] * s[_XI + 1], -clamp), clamp)
        if extra[m] == extra[m]:
            v += extra[m]
        out[m] = v
        if v - v != 0.0:  # NaN or infinite
            v = 0.0
        out[2 + m] = min(max(v, -p[_V_MAX]), p[_V_MAX])
    # 4. The integrals of the roll and the yaw error.
    for i in range(2):
        xi = s[_XI + i] + p[_DT] * (e_yaw if i else e_roll)
        s[_XI + i] = min(max(xi, -p[_XI_MAX + i]), p[_XI_MAX + i])


def parameters(spec: ControllerSpec, V_o: float, v_max: float, dt: float) -> list[float]:
    """Return the flat parameter list that `control_law` reads, from the controller's specification.

    ``V_o``: hover voltage (V); ``v_max``: voltage limit (V); ``dt``: control period (s).
    """
    b0, a1, a2 = derivative_filter(spec, dt)
    ref_step = float(np.deg2rad(spec.reference_rate_limit_deg_per_s)) * dt
    # The motor with the smaller gain reaches the clamp last.
    weaker = [min((abs(row[j]) for row in spec.K if row[j]), default=0.0) for j in (6, 7)]
    xi_max = [spec.integrator_clamp_V / gain if gain else np.inf for gain in weaker]
    head = [dt, V_o, v_max, ref_step, spec.integrator_clamp_V, b0, a1, a2, *xi_max]
    return [float(x) for x in head] + [float(x) for row in spec.K for x in row]


def derivative_filter(spec: ControllerSpec, dt: float) -> tuple[float, float, float]:
    """Return the coefficients (b0, a1, a2) of the filter from an angle (rad) to its rate (rad/s).

    H(z) = b0 (1 − z⁻²) / (1 + a1 z⁻¹ + a2 z⁻²) is ω² s / (s² + 2 ζ ω s + ω²) discretised by Tustin,
    s = (2/dt)(z − 1)/(z + 1). ω (rad/s) and ζ are in ``spec``; ``dt`` s is the control period.
    """
    w = 2 * np.pi * spec.derivative_cutoff_hz
    zeta = spec.derivative_damping
    c = 2 / dt
    a0 = c**2 + 2 * zeta * w * c + w**2
    return (
        float(w**2 * c / a0),
        float((2 * w**2 - 2 * c**2) / a0),
        float((c**2 - 2 * zeta * w * c + w**2) / a0),
    )


def state_at_rest(p: Sequence[float], angle: Sequence[float]) -> list[float]:
    """Return the controller state for a rig at rest at ``angle`` (3,) rad.

    ``p`` is from `parameters`. The rate-limited references equal the angles; filtered rates and
    integrals are zero.
    """
    angle = [a if abs(a) < _LARGEST_ANGLE else 0.0 for a in angle]
    s = [0.0] * N_STATE
    for i in range(3):
        s[_LIMITED + i] = s[_GOOD + i] = angle[i]
        s[_FILTER + 2 * i] = s[_FILTER + 2 * i + 1] = -p[_B0] * angle[i]
    return s


def open_loop_bounds(limits: Limits) -> list[float]:
    """Return the bounds within which a loop may be open: `SHARE` of the safety envelope ``limits``.

    The list is [roll low, roll high, |pitch|, |yaw|, |roll rate|, |pitch rate|, |yaw rate|] in rad
    and rad/s.
    """
    middle = (limits.roll_max_deg + limits.roll_min_deg) / 2
    half = SHARE * (limits.roll_max_deg - limits.roll_min_deg) / 2
    rest = (limits.pitch_max_deg, limits.yaw_max_deg, *limits.rates_deg_per_s)
    return [radians(v) for v in (middle - half, middle + half, *(SHARE * r for r in rest))]


def open_loop_arguments(task: LoopTask) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the arguments (mode, bounds, z) that `before_law` needs to open control loops.

    They are for a simulation of ``task``, a flight of N control periods:

    - mode (N, 3): the mode of each axis in each period. 0: closed loop. 1: closed loop, in which
      the controller averages the axis's part of the voltage. 2: open loop. The shape is (0, 3) if
      the flight opens no loop.
    - bounds (7,): the angles and rates beyond which all loops are closed (`open_loop_bounds`).
    - z: what `before_law` and `after_law` store from period to period, initially zeros.
    """
    modes = np.zeros((0, 3), dtype=np.int8) if task.opened is None else task.opened
    return (
        np.ascontiguousarray(modes, dtype=np.int8),
        np.array(open_loop_bounds(task.limits)),
        np.zeros(N_OPEN_LOOP_STATE),
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

    ``p``, ``s``: parameters and state of `control_law`; ``angle`` (3) rad: measured. ``z`` stores
    values from period to period, `N_OPEN_LOOP_STATE` zeros at the start. The function overwrites
    ``reference`` (3) rad with the references to apply. It moves ``extra`` (2) V, the excitation, to
    ``z``, where `after_law` reads it. `before_law` and `after_law` run on Python lists and under
    ``numba.njit`` on float64 arrays.
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
    """Replace the feedback of the axes in open loop by constant voltages; add the excitation.

    `control_law` has computed the motor voltages as a sum of contributions, one from each axis:

    - If the axis has the mode LEARN, its loop is closed. The function averages its contribution.
    - If the loop of the axis is open, the function replaces the contribution by this mean. For
      this, it computes a correction voltage: mean minus contribution, summed over the open axes.

    Once all loops are closed, the correction voltage decays with the time constant `FADE_S`.

    The function writes the sum of correction voltage and excitation to ``extra`` (2) V, and adds
    it to the voltages in ``out``. ``out`` (4) V contains the commanded voltages (front, back), then
    the same limited to ±v_max. ``p``, ``s``: parameters and state of `control_law`. ``mode`` (3),
    ``z``: see `before_law`.
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


class Controller:
    """The default controller in plain Python, for the real-time loop: a few µs per period.

    >>> from heli3dof.rig.profile import default_profile
    >>> c = Controller.of(default_profile())
    >>> c.reset((0.0, 0.0, 0.0))
    >>> c.step((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    ((7.456, 7.456), (7.456, 7.456))
    """

    def __init__(
        self,
        spec: ControllerSpec,
        V_o: float,
        v_max: float,
        dt: float,
        limits: Limits = Limits(),
    ) -> None:
        self.spec, self.dt = spec, dt
        self._p = parameters(spec, V_o, v_max, dt)
        self._s = state_at_rest(self._p, (0.0, 0.0, 0.0))
        self._out = [0.0] * N_OUT
        self._bounds = open_loop_bounds(limits)
        self._z = [0.0] * N_OPEN_LOOP_STATE

    @classmethod
    def of(cls, profile: Any) -> Controller:
        """Return the controller of a rig's `Profile`, or the paper's if the profile has none."""
        profile = profile.with_controller()
        motor = profile.motor
        return cls(profile.controller, motor.V_o, motor.v_max, profile.dt, profile.limits)

    def reset(self, angle: Sequence[float] | np.ndarray) -> None:
        """Set the controller state to that of a rig at rest at the angles ``angle`` (3,) rad."""
        self._s = state_at_rest(self._p, [float(a) for a in angle])

    def step(
        self,
        angle: Sequence[float] | np.ndarray,
        reference: Sequence[float] | np.ndarray,
        extra: Sequence[float] | np.ndarray = (0.0, 0.0),
    ) -> tuple[tuple[float, float], tuple[float, float]]:
        """Compute one control period from measured angles and references (3,) rad.

        ``extra`` (2,) V is an excitation added to the controller's output. Returns (v_cmd, v), each
        (front, back) in V: before and after the limiter ±v_max.
        """
        out = self._out
        # Python floats: numpy scalars would be several times slower in the law.
        control_law(
            self._p,
            self._s,
            (float(angle[0]), float(angle[1]), float(angle[2])),
            (float(reference[0]), float(reference[1]), float(reference[2])),
            (float(extra[0]), float(extra[1])),
            out,
        )
        return (out[0], out[1]), (out[2], out[3])

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

        ``mode`` (3) contains for each axis:

        - 0 CLOSED: closed loop.
        - 1 LEARN: closed loop; the controller averages the voltage due to this axis's feedback.
        - 2 OPEN: open loop; the mean voltage replaces this axis's feedback.

        ``angle`` (3) rad: measured; ``reference`` (3) rad: from the plan; ``extra`` (2) V: the
        excitation. Returns four tuples. The first is the reference (3,) rad that the controller
        used; for an open axis, it is the measured angle. The second is the voltage (2,) V added to
        the control law: the excitation, plus the change due to open loops. The last two are the
        motor voltages (2,) V before and after the limiter.
        """
        r, e, out = list(reference), list(extra), self._out
        before_law(self._p, self._s, self._bounds, self._z, mode, angle, r, e)
        control_law(self._p, self._s, angle, r, e, out)
        after_law(self._p, self._s, self._z, mode, e, out)
        return (r[0], r[1], r[2]), (e[0], e[1]), (out[0], out[1]), (out[2], out[3])

    @property
    def limited_reference(self) -> tuple[float, float, float]:
        """Return the rate-limited references (3,) rad that the last `step` used."""
        s = self._s
        return s[_LIMITED], s[_LIMITED + 1], s[_LIMITED + 2]

    @property
    def rates(self) -> tuple[float, float, float]:
        """Return the filtered angular rates (3,) rad/s that the last `step` computed."""
        s = self._s
        return s[_RATE], s[_RATE + 1], s[_RATE + 2]
