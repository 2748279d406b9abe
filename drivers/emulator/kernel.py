"""Compiled simulation of the plant over one control period.

Each substep of length h computes, in this order:

1. the motor voltages
2. the thrusts, by the exact solution of the rotors' first-order lag
3. the rigid body's motion, by the classical fourth-order Runge–Kutta method
4. dry friction and mechanical stops, as impulses

Dry friction is set-valued: at rest its torque holds axis i, up to its limit τ_i. So after the
Runge–Kutta step each axis with friction gets the impulse λ_i that stops it, clipped to ±τ_i h. Each
axis at a stop gets the one-sided impulse that ends its outward motion (inelastic). The impulses are
iterated over the axes because the mass matrix M couples them (projected Gauss–Seidel). A torque
λ/h, constant over the substep, also moves the angles by ½ h M⁻¹λ. The kernel adds this movement for
dry friction; otherwise an axis at rest would creep.
"""

from __future__ import annotations

import hashlib
import math
from functools import cache
from pathlib import Path
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba import njit
from numba.extending import intrinsic

from . import plant_layout as at
from .lagrange import accelerations, mass_matrix, solve

SWEEPS = 30
"""Largest number of Gauss–Seidel iterations"""

R, R_DOT, F_FRONT, F_BACK = at.R, at.R_DOT, at.F_FRONT, at.F_BACK
V_FRONT, V_BACK, T, H = at.V_FRONT, at.V_BACK, at.T, at.H
V_START, CONTEXT_SIZE, BODY_SIZE = at.V_START, at.CONTEXT_SIZE, at.BODY_SIZE
K_F, TAU_M, GAIN_F, GAIN_B = at.K_F, at.TAU_M, at.GAIN_FRONT, at.GAIN_BACK
REST, PER_RAD = at.REST, at.COUNTS_PER_RAD
LOW, HIGH = at.LOW, at.HIGH
BODY, VOLTAGE, THRUST, TORQUE, DRY, MEASURE = (int(stage) for stage in at.Stage)


@intrinsic
def _call(
    typing_context: Any, address: Any, s: Any, body: Any, par: Any, mem: Any, out: Any
) -> Any:
    """Call the effect's function at ``address`` with the arguments that `plant_effects` defines."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        types = [context.get_value_type(t) for t in signature.args[1:]]
        function = ir.FunctionType(context.get_value_type(numba.types.void), types)
        builder.call(builder.inttoptr(args[0], function.as_pointer()), args[1:])
        return context.get_dummy_value()

    return numba.types.void(address, s, body, par, mem, out), generate


@njit
def _hooks(stage, s, body, first, address, par, mem, out):  # type: ignore[no-untyped-def]
    for i in range(first[stage], first[stage + 1]):
        _call(address[i], s, body, par[i], mem[i], out)  # type: ignore[call-arg]


@njit(error_model="numpy")
def _lag(state, target_f, target_b, tau, elapsed, force):  # type: ignore[no-untyped-def]
    """Write to ``force`` the thrusts F (front, back) in N of rotors with a first-order lag.

    Each F solves τ Ḟ = target − F. ``tau``: τ, s; ``target_f``, ``target_b``: targets, N;
    ``elapsed``: time in s since the thrusts were ``state[6:8]``.
    """
    left = 0.0 if tau <= 0.0 else math.exp(-elapsed / tau)
    force[0] = target_f + (state[6] - target_f) * left
    force[1] = target_b + (state[7] - target_b) * left


@njit(error_model="numpy")
def _impulses(state, h, dry, body):  # type: ignore[no-untyped-def]
    """Apply dry friction (limits ``dry``, N·m) and mechanical stops after a substep of h s."""
    low, high = body[LOW : LOW + 3], body[HIGH : HIGH + 3]
    active = False
    for i in range(3):
        active = active or dry[i] > 0.0 or state[i] <= low[i] or state[i] >= high[i]
    if not active:
        return
    m = mass_matrix(body, state[0], state[1])
    W = np.empty((3, 3))
    W[0, 0], W[1, 0], W[2, 0] = solve(m, 1.0, 0.0, 0.0)
    W[0, 1], W[1, 1], W[2, 1] = solve(m, 0.0, 1.0, 0.0)
    W[0, 2], W[1, 2], W[2, 2] = solve(m, 0.0, 0.0, 1.0)
    friction, contact = np.zeros(3), np.zeros(3)
    for _sweep in range(SWEEPS):
        change = 0.0
        for i in range(3):
            limit = dry[i] * h
            stop = friction[i] - state[3 + i] / W[i, i]
            step = min(limit, max(-limit, stop)) - friction[i]
            friction[i] += step
            for j in range(3):
                state[3 + j] += W[j, i] * step
            change += abs(step)
            if state[i] <= low[i]:
                step = max(0.0, contact[i] - state[3 + i] / W[i, i]) - contact[i]
            elif state[i] >= high[i]:
                step = min(0.0, contact[i] - state[3 + i] / W[i, i]) - contact[i]
            else:
                continue
            contact[i] += step
            for j in range(3):
                state[3 + j] += W[j, i] * step
            change += abs(step)
        if change < 1e-15:
            break
    for i in range(3):
        for j in range(3):
            state[i] += 0.5 * h * W[i, j] * friction[j]
    for i in range(3):
        state[i] = min(high[i], max(low[i], state[i]))


@njit(error_model="numpy")
def _copy(source, into, at, n):  # type: ignore[no-untyped-def]
    """Copy n numbers of ``source`` to ``into[at:]``."""
    # numba would take 4 s longer to compile a slice assignment.
    for i in range(n):
        into[at + i] = source[i]


@njit(error_model="numpy")
def _counts(state, t, body, first, address, par, mem):  # type: ignore[no-untyped-def]
    s = np.zeros(CONTEXT_SIZE)
    s[T] = t
    _copy(state, s, R, 6)
    angle = state[:3].copy()
    _hooks(MEASURE, s, body, first, address, par, mem, angle)
    for i in range(3):
        angle[i] = np.rint((angle[i] - body[REST + i]) * body[PER_RAD + i])
    return int(angle[0]), int(angle[1]), int(angle[2])


def _sources() -> str:
    """Return a hash of the compiled functions' source files, a part of numba's cache key."""
    h = hashlib.sha256()
    for name in ("kernel.py", "lagrange.py", "plant_layout.py"):
        h.update(Path(__file__).with_name(name).read_bytes())
    return h.hexdigest()


def _compile(digest: str) -> tuple[Any, Any]:
    # Both functions use the digest, so it is part of their key in numba's cache.
    @njit(cache=True, error_model="numpy")
    def period(  # type: ignore[no-untyped-def]
        state, v_f, v_b, noise, t, dt, substeps, start_V, body0, first, address, par, mem
    ):
        """Advance ``state`` = (r, p, ψ, ṙ, ṗ, ψ̇, F_f, F_b) by ``dt`` s from ``t``; rad, rad/s, N.

        Returns the encoders' counts at the end. The voltages ``v_f``, ``v_b`` (V) and the random
        torques ``noise`` (3,) (N·m) are constant. The period has ``substeps`` integration steps.
        ``start_V``: both motors' voltage before t = 0; ``body0``: body parameters; ``first`` …
        ``mem``: the effects' arrays (`plant._attach`).
        """
        _ = digest
        h = dt / substeps
        # One allocation with many views: this runs in every control period.
        work = np.zeros(CONTEXT_SIZE + BODY_SIZE + 40)
        s, rest = work[:CONTEXT_SIZE], work[CONTEXT_SIZE + BODY_SIZE :]
        body = work[CONTEXT_SIZE : CONTEXT_SIZE + BODY_SIZE]
        volts, force, torque, dry = rest[0:2], rest[2:4], rest[4:7], rest[7:10]
        q, qd = rest[10:13], rest[13:16]
        kq, kv = rest[16:28].reshape(4, 3), rest[28:40].reshape(4, 3)
        _copy(body0, body, 0, BODY_SIZE)
        s[V_START] = start_V
        s[H] = h
        for step in range(substeps):
            s[T] = t + step * h
            _copy(state, s, R, 6)
            s[V_FRONT], s[V_BACK] = v_f, v_b
            s[F_FRONT], s[F_BACK] = state[6], state[7]
            if first[BODY + 1] > first[BODY]:
                _copy(body0, body, 0, BODY_SIZE)
                _hooks(BODY, s, body, first, address, par, mem, body)
            volts[0], volts[1] = v_f, v_b
            _hooks(VOLTAGE, s, body, first, address, par, mem, volts)
            s[V_FRONT], s[V_BACK] = volts[0], volts[1]
            target_f = body[K_F] * body[GAIN_F] * volts[0]
            target_b = body[K_F] * body[GAIN_B] * volts[1]
            tau = body[TAU_M]
            for stage in range(4):
                part = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
                for i in range(3):
                    q[i], qd[i] = state[i], state[3 + i]
                    if stage > 0:
                        q[i] += part * h * kq[stage - 1, i]
                        qd[i] += part * h * kv[stage - 1, i]
                    s[R + i], s[R_DOT + i] = q[i], qd[i]
                s[T] = t + (step + part) * h
                _lag(state, target_f, target_b, tau, part * h, force)
                s[F_FRONT], s[F_BACK] = force[0], force[1]
                _hooks(THRUST, s, body, first, address, par, mem, force)
                s[F_FRONT], s[F_BACK] = force[0], force[1]
                _copy(noise, torque, 0, 3)
                _hooks(TORQUE, s, body, first, address, par, mem, torque)
                _copy(qd, kq[stage], 0, 3)
                accelerations(body, q, qd, force[0], force[1], torque, kv[stage])
            for i in range(3):
                state[i] += h / 6 * (kq[0, i] + 2 * kq[1, i] + 2 * kq[2, i] + kq[3, i])
                state[3 + i] += h / 6 * (kv[0, i] + 2 * kv[1, i] + 2 * kv[2, i] + kv[3, i])
            _lag(state, target_f, target_b, tau, h, force)
            state[6], state[7] = force[0], force[1]
            _copy(state, s, R, 6)
            dry[:] = 0.0
            _hooks(DRY, s, body, first, address, par, mem, dry)
            _impulses(state, h, dry, body)
        return _counts(state, t + dt, body0, first, address, par, mem)

    @njit(cache=True, error_model="numpy")
    def measure(state, t, body, first, address, par, mem):  # type: ignore[no-untyped-def]
        """Return the encoders' counts (3 integers) for ``state`` at time ``t`` (s).

        ``body``: body parameters; ``first`` … ``mem``: the effects' arrays (`plant._attach`).
        """
        _ = digest
        return _counts(state, t, body, first, address, par, mem)

    return period, measure


@cache
def compiled() -> tuple[Any, Any]:
    """Return the compiled functions ``period`` (one control period) and ``measure`` (counts)."""
    period, measure = _compile(_sources())
    one, two, integers = numba.float64[::1], numba.float64[:, ::1], numba.int64[::1]
    number, whole = numba.float64, numba.int64
    period.compile(
        (one, number, number, one, number, number, whole, number, one, integers, integers, two, two)
    )
    measure.compile((one, number, one, integers, integers, two, two))
    return period, measure
