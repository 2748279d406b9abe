"""The simulation step: rigid body, rotors, effects, dry friction, and the table under the rig.

The roll angle cannot fall below the angle at which the rig rests on its table (`stop_at_table`).
Filters, closed loops and predictions use these functions. A row is a sample: row k has the time
t[k] (s), and h[k] (s) is the time to the next row. V[k] are the two motor voltages (V) in this
interval. The functions also share these arguments:

- ``s``: parameters and state of the rig (`heli3dof.model.physics.state_layout`)
- ``x`` (6,): the three angles q (rad), then their rates q̇ (rad/s)
- ``first``, ``address``, ``par``, ``mem``: the active effects (`Structure.arguments` of
  `physics.parametrisation`)
- ``target`` (rows, 2): in newtons, the thrusts that each row's voltages cause in steady state
- ``F`` (rows, 2): in newtons, the actual thrusts at the time of each row (`physics.rotor`)
- ``free`` (3,): True for each axis that can move
- ``w`` (8, 3): work space
- ``cache`` (6,): values that a step keeps for the next step. Before the first step, cache[0] is −1
"""

from __future__ import annotations

import math

from heli3dof.model.compiled import inlined
from heli3dof.model.physics import state_layout as _s
from heli3dof.model.physics.compiled_effects import caller
from heli3dof.model.physics.dry_friction import apply_dry_friction
from heli3dof.model.physics.rigid_body import accelerations, advance
from heli3dof.model.physics.rotor import lagged, steady_thrusts

call = caller()
R, T, F_FRONT, V_FRONT = _s.R, _s.T, _s.F_FRONT, _s.V_FRONT
FLANK, STEPPED = _s.FLANK, _s.STEPPED
TAU_M, K_F, GAIN_FRONT, SLEW = _s.TAU_M, _s.K_F, _s.GAIN_FRONT, _s.SLEW
SETUP, MEASURE = int(_s.Stage.SETUP), int(_s.Stage.MEASURE)


@inlined
def setup(s, first, address, par, mem):  # type: ignore[no-untyped-def]
    """Let the effects change parameters of the rig; called once before each simulation.

    An effect such as an added mass writes the changed parameters to the array ``s``. All arguments
    are explained at the head of this file.
    """
    for i in range(first[SETUP], first[SETUP + 1]):
        call(address, i, s, par, mem, s)


@inlined
def step(s, x, k, t, h, V, target, F, first, address, par, mem, free, w, cache):  # type: ignore[no-untyped-def]
    """Advance the state x (angles, rates) from row k to the next, with dry friction.

    cache[:3] holds h, exp(−h/2τ), exp(−h/τ) from the previous step, with the step h (s) and the
    rotors' lag τ (s). The thrusts (N) at the end of the step are written to w[7, :2]. Other
    arguments: see the head of this file.
    """
    if cache[0] != h[k]:
        cache[0] = h[k]
        tau = s[TAU_M]
        cache[1] = math.exp(-0.5 * h[k] / tau) if tau > 0.0 else 0.0
        cache[2] = cache[1] * cache[1]
    s[T], s[STEPPED] = t[k], 1.0
    s[V_FRONT], s[V_FRONT + 1] = V[k, 0], V[k, 1]
    for m in range(2):
        # Without a lag the thrust equals the target from the start of the row.
        w[5, m] = F[k, m] if s[TAU_M] > 0.0 else target[k, m]
        w[6, m] = target[k, m] + (F[k, m] - target[k, m]) * cache[1]
        w[7, m] = target[k, m] + (F[k, m] - target[k, m]) * cache[2]
        if s[SLEW] > 0.0:
            slew = s[SLEW] * s[K_F] * s[GAIN_FRONT + m]
            w[5, m] = F[k, m]
            w[6, m] = lagged(F[k, m], target[k, m], s[TAU_M], slew, 0.5 * h[k])
            w[7, m] = lagged(F[k, m], target[k, m], s[TAU_M], slew, h[k])
    advance(s, x, h[k], w[5], w[6], w[7], first, address, par, mem, free, w)
    w[3, 0] = w[3, 1] = w[3, 2] = 0.0
    apply_dry_friction(s, x, h[k], first, address, par, mem, free, w)


@inlined
def stop_at_table(x, low):  # type: ignore[no-untyped-def]
    """Stop a fall at the table, where roll is ``low`` (rad).

    If roll x[0] is below ``low``, it becomes ``low``, and a negative roll rate x[3] becomes zero.
    """
    if x[0] < low:
        x[0] = low
        if x[3] < 0.0:
            x[3] = 0.0


@inlined
def fly_row(s, x, k, t, h, V, target, F, first, address, par, mem, free, w, cache):  # type: ignore[no-untyped-def]
    """Advance the state x (angles, rates) and the thrusts F from row k to the next.

    Writes target[k], the steady-state thrusts at the voltage of row k, and F[k + 1]. Other
    arguments: see the head of this file.
    """
    steady_thrusts(s, V, h, 0, k, first, address, par, mem, target[k])
    step(s, x, k, t, h, V, target, F, first, address, par, mem, free, w, cache)
    if k + 1 < F.shape[0]:
        F[k + 1, 0], F[k + 1, 1] = w[7, 0], w[7, 1]


@inlined
def midpoint_without_dry_friction(  # type: ignore[no-untyped-def]
    s, x, k, t, h, V, target, F, first, address, par, mem, free, w, cache
):  # fmt: skip
    """Advance the state x as `step` does, but without dry friction and by the midpoint rule.

    The effects are evaluated at the rate in the middle of the step, predicted by the acceleration
    of the previous step, cache[3:6]. With the rate at the start instead, an axis of inertia J and
    viscous friction c q̇ would accelerate as if its inertia were J − c h/2.
    """
    if cache[0] < 0.0:
        cache[3] = cache[4] = cache[5] = 0.0
    if cache[0] != h[k]:
        cache[0] = h[k]
        cache[1] = math.exp(-0.5 * h[k] / s[TAU_M]) if s[TAU_M] > 0.0 else 0.0
    s[T], s[STEPPED] = t[k], 1.0
    s[V_FRONT], s[V_FRONT + 1] = V[k, 0], V[k, 1]
    for m in range(2):
        s[F_FRONT + m] = target[k, m] + (F[k, m] - target[k, m]) * cache[1]
        if s[SLEW] > 0.0:
            slew = s[SLEW] * s[K_F] * s[GAIN_FRONT + m]
            s[F_FRONT + m] = lagged(F[k, m], target[k, m], s[TAU_M], slew, 0.5 * h[k])
    for i in range(3):
        s[R + i] = x[i] + 0.5 * h[k] * x[3 + i]
        s[R + 3 + i] = x[3 + i] + 0.5 * h[k] * cache[3 + i]
    accelerations(s, first, address, par, mem, free, w[0], w[1], w[2])
    for i in range(3):
        x[i] += h[k] * x[3 + i] + 0.5 * h[k] * h[k] * w[2, i]
        x[3 + i] += h[k] * w[2, i]
        cache[3 + i] = w[2, i]


@inlined
def step_midpoint(s, x, k, t, h, V, target, F, first, address, par, mem, free, w, cache):  # type: ignore[no-untyped-def]
    """Advance the state x by one row as `step` does, but by the midpoint rule."""
    midpoint_without_dry_friction(
        s, x, k, t, h, V, target, F, first, address, par, mem, free, w, cache
    )
    w[3, 0] = w[3, 1] = w[3, 2] = 0.0
    apply_dry_friction(s, x, h[k], first, address, par, mem, free, w)


@inlined
def mean_thrust_step(s, x, a, b, h, thrust_integral, V, first, address, par, mem, free, w):  # type: ignore[no-untyped-def]
    """Advance the state x from row a to row b by a midpoint step of ``h`` s, without dry friction.

    ``thrust_integral`` (N + 1, 2) N·s is the time integral of the thrusts up to each row. The step
    uses the mean thrusts from row a to row b. Other arguments: see the head of this file.
    """
    s[V_FRONT], s[V_FRONT + 1] = V[a, 0], V[a, 1]
    for half in range(2):
        for m in range(2):  # set again in each half: effects change them in place
            s[F_FRONT + m] = (thrust_integral[b, m] - thrust_integral[a, m]) / h
        for i in range(3):
            if half == 0:
                s[R + i] = x[i] + 0.5 * h * x[3 + i]
                s[R + 3 + i] = x[3 + i]
            else:  # the rate in the middle of the step, for effects that depend on it
                s[R + 3 + i] = x[3 + i] + 0.5 * h * w[2, i]
        accelerations(s, first, address, par, mem, free, w[0], w[1], w[2])
    for i in range(3):
        x[i] += h * x[3 + i] + 0.5 * h * h * w[2, i]
        x[3 + i] += h * w[2, i]


@inlined
def mean_thrust_steps(  # type: ignore[no-untyped-def]
    s, x, a, end, stride, t, thrust_integral, V, low, first, address, par, mem, free, w
):
    """Advance the state x from row a to row ``end`` in time steps of ``stride`` rows.

    Each step is `mean_thrust_step`, then dry friction. Then roll is limited to at least ``low``
    (rad), at which the rig lies on the table. ``thrust_integral``: see `mean_thrust_step`. Other
    arguments: see the head of this file.
    """
    while a < end:
        b = min(a + stride, end)
        h = t[b] - t[a]
        s[T], s[STEPPED] = t[a], 1.0
        mean_thrust_step(s, x, a, b, h, thrust_integral, V, first, address, par, mem, free, w)
        w[3, 0] = w[3, 1] = w[3, 2] = 0.0
        apply_dry_friction(s, x, h, first, address, par, mem, free, w)
        stop_at_table(x, low)
        a = b


@inlined
def readings(s, x, first, address, par, mem, m, slope):  # type: ignore[no-untyped-def]
    """Write the unquantised encoder readings, (3,) rad, at the state x into m.

    ``slope`` (3,) becomes ∂m_i/∂q_i, with the angles q. s[FLANK + i] selects the side of the
    backlash of encoder i (`state_layout.FLANK`). Other arguments: see the head of this file.
    """
    for i in range(3):
        m[i] = x[i]
        slope[i] = 1.0
    if first[MEASURE + 1] > first[MEASURE]:
        for i in range(3):
            slope[i] = x[i] + 1e-6
            s[R + i], s[R + 3 + i] = x[i], x[3 + i]
        for e in range(first[MEASURE], first[MEASURE + 1]):
            call(address, e, s, par, mem, m)
            # The call for the slope has an angle that did not occur: restore the effect's memory
            # afterwards from the last row of mem, which belongs to no effect.
            for n in range(mem.shape[1]):
                mem[mem.shape[0] - 1, n] = mem[e, n]
            call(address, e, s, par, mem, slope)
            for n in range(mem.shape[1]):
                mem[e, n] = mem[mem.shape[0] - 1, n]
        for i in range(3):
            slope[i] = (slope[i] - m[i]) / 1e-6


@inlined
def flanks(s, x, i, first, address, par, mem, m, slope):  # type: ignore[no-untyped-def]
    """Return encoder i's readings at the state x for a rising and a falling angle, and their slope.

    The two readings (rad) differ by the backlash; the slope is ∂reading/∂angle. m (3,) and
    ``slope`` (3,) are work space. Other arguments: see the head of this file.
    """
    s[FLANK + i] = 1.0
    readings(s, x, first, address, par, mem, m, slope)
    rising, steep = m[i], slope[i]
    s[FLANK + i] = -1.0
    readings(s, x, first, address, par, mem, m, slope)
    return rising, m[i], steep
