"""One sample of a rig with effects: set up, a step forward, and what the encoders should read.

Common to the filter, the closed loop and the predictions. Arguments ``first``, ``address``,
``par``, ``mem`` are the effects that are on (`heli3dof.model.physics.parametrisation`); ``target``
and ``F`` (N, 2) N are what the voltages aim at and the thrusts at each row's start
(`heli3dof.model.physics.rotor`).
"""

from __future__ import annotations

import math

from heli3dof.model.compiled import compiled
from heli3dof.model.physics import dry_friction, rigid_body, rotor
from heli3dof.model.physics import state_layout as _s
from heli3dof.model.physics.compiled_effects import caller
from heli3dof.model.physics.dry_friction import settle
from heli3dof.model.physics.rigid_body import accelerations, advance
from heli3dof.model.physics.rotor import lagged

call = caller()
R, T, F_FRONT, V_FRONT = _s.R, _s.T, _s.F_FRONT, _s.V_FRONT
FLANK, STEPPED = _s.FLANK, _s.STEPPED
TAU_M, K_F, GAIN_FRONT, SLEW = _s.TAU_M, _s.K_F, _s.GAIN_FRONT, _s.SLEW
SETUP, MEASURE = int(_s.Stage.SETUP), int(_s.Stage.MEASURE)


def _setup(s, first, address, par, mem):  # type: ignore[no-untyped-def]
    for i in range(first[SETUP], first[SETUP + 1]):
        call(address, i, s, par, mem, s)


setup = compiled(_setup, leaf=True, error_model="numpy")


def _leap(s, x, k, t, h, V, target, F, first, address, par, mem, free, w, decay):  # type: ignore[no-untyped-def]
    """x (6,) from row k to the next, dry friction aside.

    ``decay`` (3,) keeps exp(−h/2τ) and exp(−h/τ) for its h; w (8, 3) is work space, whose last row
    holds the thrusts at the end.
    """
    if decay[0] != h[k]:
        decay[0] = h[k]
        tau = s[TAU_M]
        decay[1] = math.exp(-0.5 * h[k] / tau) if tau > 0.0 else 0.0
        decay[2] = decay[1] * decay[1]
    s[T], s[STEPPED] = t[k], 1.0
    s[V_FRONT], s[V_FRONT + 1] = V[k, 0], V[k, 1]
    for m in range(2):
        # Without a lag the thrust is the target from the first instant.
        w[5, m] = F[k, m] if s[TAU_M] > 0.0 else target[k, m]
        w[6, m] = target[k, m] + (F[k, m] - target[k, m]) * decay[1]
        w[7, m] = target[k, m] + (F[k, m] - target[k, m]) * decay[2]
        if s[SLEW] > 0.0:
            slew = s[SLEW] * s[K_F] * s[GAIN_FRONT + m]
            w[5, m] = F[k, m]
            w[6, m] = lagged(F[k, m], target[k, m], s[TAU_M], slew, 0.5 * h[k])
            w[7, m] = lagged(F[k, m], target[k, m], s[TAU_M], slew, h[k])
    advance(s, x, h[k], w[5], w[6], w[7], first, address, par, mem, free, w)


leap = compiled(_leap, calls=(rigid_body._advance, rotor._lagged), leaf=True, error_model="numpy")


def _step(s, x, k, t, h, V, target, F, first, address, par, mem, free, w, decay):  # type: ignore[no-untyped-def]
    """As `_leap`, and what dry friction makes of it."""
    leap(s, x, k, t, h, V, target, F, first, address, par, mem, free, w, decay)
    w[3, 0] = w[3, 1] = w[3, 2] = 0.0
    settle(s, x, h[k], first, address, par, mem, free, w)


step = compiled(
    _step, calls=(_leap, rigid_body._advance, rotor._lagged, dry_friction._settle),
    leaf=True, error_model="numpy",
)  # fmt: skip


def _glide(s, x, k, t, h, V, target, F, first, address, par, mem, free, w, decay):  # type: ignore[no-untyped-def]
    """As `_step`, by the midpoint rule: a third of the work, for differences of two runs."""
    if decay[0] != h[k]:
        decay[0] = h[k]
        decay[1] = math.exp(-0.5 * h[k] / s[TAU_M]) if s[TAU_M] > 0.0 else 0.0
    s[T], s[STEPPED] = t[k], 1.0
    s[V_FRONT], s[V_FRONT + 1] = V[k, 0], V[k, 1]
    for m in range(2):
        s[F_FRONT + m] = target[k, m] + (F[k, m] - target[k, m]) * decay[1]
        if s[SLEW] > 0.0:
            slew = s[SLEW] * s[K_F] * s[GAIN_FRONT + m]
            s[F_FRONT + m] = lagged(F[k, m], target[k, m], s[TAU_M], slew, 0.5 * h[k])
    for i in range(3):
        s[R + i] = x[i] + 0.5 * h[k] * x[3 + i]
        s[R + 3 + i] = x[3 + i]
    accelerations(s, first, address, par, mem, free, w[0], w[1], w[2])
    for i in range(3):
        x[i] += h[k] * x[3 + i] + 0.5 * h[k] * h[k] * w[2, i]
        x[3 + i] += h[k] * w[2, i]
    w[3, 0] = w[3, 1] = w[3, 2] = 0.0
    settle(s, x, h[k], first, address, par, mem, free, w)


glide = compiled(
    _glide, calls=(rigid_body._accelerations, rotor._lagged, dry_friction._settle),
    leaf=True, error_model="numpy",
)  # fmt: skip


def _coast(s, x, a, b, h, mean, V, first, address, par, mem, free, w):  # type: ignore[no-untyped-def]
    """x (6,) over the h s from row a to row b at once, by the midpoint rule, dry friction aside.

    ``mean`` (N + 1, 2) N·s is the thrusts' running integral: their mean over the step counts.
    """
    s[V_FRONT], s[V_FRONT + 1] = V[a, 0], V[a, 1]
    for half in range(2):
        for m in range(2):  # each time anew: effects change them in place
            s[F_FRONT + m] = (mean[b, m] - mean[a, m]) / h
        for i in range(3):
            if half == 0:
                s[R + i] = x[i] + 0.5 * h * x[3 + i]
                s[R + 3 + i] = x[3 + i]
            else:  # the rate at the middle, for what depends on it
                s[R + 3 + i] = x[3 + i] + 0.5 * h * w[2, i]
        accelerations(s, first, address, par, mem, free, w[0], w[1], w[2])
    for i in range(3):
        x[i] += h * x[3 + i] + 0.5 * h * h * w[2, i]
        x[3 + i] += h * w[2, i]


coast = compiled(
    _coast, calls=(rigid_body._accelerations, rigid_body._body_accelerations),
    leaf=True, error_model="numpy",
)  # fmt: skip


def _readings(s, x, first, address, par, mem, m, slope):  # type: ignore[no-untyped-def]
    """What the encoders should read, (3,) rad into m, and ∂m_i/∂q_i into ``slope``.

    Which flank of a play carries its encoder is s[FLANK + i]; see
    `heli3dof.model.physics.state_layout`.
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
            # The slope is an angle that never was: nothing may remember it. Of mem the last row
            # is no effect's.
            for n in range(mem.shape[1]):
                mem[mem.shape[0] - 1, n] = mem[e, n]
            call(address, e, s, par, mem, slope)
            for n in range(mem.shape[1]):
                mem[e, n] = mem[mem.shape[0] - 1, n]
        for i in range(3):
            slope[i] = (slope[i] - m[i]) / 1e-6


readings = compiled(_readings, leaf=True, error_model="numpy")


def _flanks(s, x, i, first, address, par, mem, m, slope):  # type: ignore[no-untyped-def]
    """(reading of axis i while its angle rises, while it falls, ∂reading/∂angle), rad."""
    s[FLANK + i] = 1.0
    readings(s, x, first, address, par, mem, m, slope)
    rising, steep = m[i], slope[i]
    s[FLANK + i] = -1.0
    readings(s, x, first, address, par, mem, m, slope)
    return rising, m[i], steep


flanks = compiled(_flanks, calls=(_readings,), leaf=True, error_model="numpy")
