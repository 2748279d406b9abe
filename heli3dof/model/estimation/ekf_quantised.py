"""Extended Kalman filter for quantised encoders: a reading is an interval of the angle.

The state is x = (q, q̇) with the angles q = (roll, pitch, yaw) and the covariance P. The rotors'
thrusts follow from the voltages without noise and are computed beforehand. The process noise is
white angular acceleration of intensity a_i² ((rad/s²)²/Hz) on each axis, so over a step h (s) P
becomes

    P ← Φ P Φᵀ + [ h³/3  h²/2 ; h²/2  h ] ⊗ diag(a²),      Φ = [ 1  h ; h ∂q̈/∂q  1 + h ∂q̈/∂q̇ ]

The derivatives are recomputed every `RELINEARISE_S`. After each step, dry friction changes x and P
(`heli3dof.model.physics.dry_friction`). An encoder may have a scale error: its reading is k times
the true angle. Then a² is the process noise of the reading, and a²/k² is that of the true angle.
Thus a fit estimates k from the motion, not from the noise level.

The readings update x and P by events (`heli3dof.model.estimation.quantised_measurement`), such as a
change of a reading. Each event acts on one component c of x. It has a likelihood L, the score
g = ∂ ln L/∂c and the information w = −∂² ln L/∂c². The update of the state is x ← x + P_c g, where
P_c is column c of P.

Σ ln L is the log-likelihood of a recording. Parameters θ′ near the filter's θ change the prediction
of c by δc. If P_c, g and w keep their values, the update is x ← x + P_c (g − w δc).
`prediction_changes` computes δc at all events for several θ′. The differences give ∂c/∂θ, which a
Gauss–Newton step needs. If θ′ changes the scale k of an encoder, the update of the angle is
multiplied by k(θ)/k(θ′), so that the update of the reading stays the same.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from heli3dof.model.compiled import compiled, inlined
from heli3dof.model.estimation.filter_data import Data
from heli3dof.model.estimation.quantised_measurement import (
    LOG_UPDATE_RATIO,
    apply_event,
    interval,
    rate_event,
)
from heli3dof.model.physics import state_layout as _s
from heli3dof.model.physics.dry_friction import apply_dry_friction, apply_friction_to_covariance
from heli3dof.model.physics.integrator import (
    flanks,
    midpoint_without_dry_friction,
    readings,
    setup,
    step_midpoint,
)
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.model.physics.rigid_body import accelerations
from heli3dof.model.physics.rotor import thrusts

R, T, F_FRONT, F_BACK, FLANK = _s.R, _s.T, _s.F_FRONT, _s.F_BACK, _s.FLANK
STEPPED = _s.STEPPED
MEASURE, DRY = int(_s.Stage.MEASURE), int(_s.Stage.DRY)
RELINEARISE_S = 0.02
"""s, the time between two linearisations."""
RATE_0 = 1.0
"""rad/s, standard deviation of the rates (mean zero) at the start of a run."""
STILL = 1e-5
"""rad; a smaller change of a reading counts as no change. Every encoder step is larger."""


@inlined
def propagate_covariance(P, A, h, a2, W):  # type: ignore[no-untyped-def]
    """Advance the filter's covariance P (6, 6) by one step of h s: P ← Φ P Φᵀ + process noise.

    ``A`` (3, 6) is ∂q̈/∂(q, q̇), ``a2`` (3,) the process noise's intensity on each axis
    ((rad/s²)²/Hz), ``W`` (3, 6) work space.
    """
    for i in range(3):
        for j in range(6):
            acc = 0.0
            for n in range(6):
                acc += A[i, n] * P[n, j]
            W[i, j] = P[3 + i, j] + h * acc
    for i in range(3):
        for j in range(6):
            P[i, j] += h * P[3 + i, j]
    for i in range(3):
        for j in range(i + 1):
            P[i, j] += h * P[i, 3 + j]
            P[j, i] = P[i, j]
    for i in range(3):
        for j in range(3):
            P[3 + i, j] = W[i, j] + h * W[i, 3 + j]
            P[j, 3 + i] = P[3 + i, j]
        for j in range(i + 1):
            acc = 0.0
            for n in range(6):
                acc += W[i, n] * A[j, n]
            P[3 + i, 3 + j] = W[i, 3 + j] + h * acc
            P[3 + j, 3 + i] = P[3 + i, 3 + j]
    for i in range(3):
        P[i, i] += a2[i] * h * h * h / 3.0
        P[i, 3 + i] += a2[i] * h * h / 2.0
        P[3 + i, i] = P[i, 3 + i]
        P[3 + i, 3 + i] += a2[i] * h


@inlined
def linearise(s, x, F, first, address, par, mem, free, w, A):  # type: ignore[no-untyped-def]
    """Write the derivatives ∂q̈/∂x (3, 6) of the accelerations q̈ to A; x: angles and rates (6,).

    F (2,) N are the thrusts, w is work space. For the other arguments see
    `heli3dof.model.physics.integrator`.
    """
    s[F_FRONT], s[F_BACK] = F[0], F[1]
    for i in range(6):
        s[R + i] = x[i]
    accelerations(s, first, address, par, mem, free, w[0], w[1], w[2])
    for j in range(6):
        s[R + j] = x[j] + 1e-5
        s[F_FRONT], s[F_BACK] = F[0], F[1]
        accelerations(s, first, address, par, mem, free, w[0], w[1], w[3])
        for i in range(3):
            A[i, j] = (w[3, i] - w[2, i]) / 1e-5
        s[R + j] = x[j]


@partial(compiled, error_model="numpy", nogil=True)
def filter_blocks(  # type: ignore[no-untyped-def]
    s0, first, address, par, mem0, blocks, free, grid, t, h, V, y, a2, jitter, R2, keep,
    loglik, row, state, C, G, W, K, X,
):  # fmt: skip
    """Run the Kalman filter; return the number E of events (measurement updates).

    The state x (6,) contains the angles and rates of roll, pitch, yaw. Input:

    - ``s0``, ``first``, ``address``, ``par``, ``mem0``: the model (`Structure.arguments`);
    - ``blocks``, ``free``, ``grid``, ``t``, ``h``, ``V``, ``y``: the fields of `Data` with these
      names, for N rows;
    - ``a2`` (3,) (rad/s²)²/Hz: process noise; ``jitter`` (s): standard deviation of the sampling
      instants;
    - R2 (3,) rad²: variance of the angle at which an encoder's reading switches. For readings that
      are not quantised: variance of their noise.

    The function adds the log-likelihood of each axis to ``loglik`` (3,). With ``keep`` ≥ 1, it
    stores for each event:

    - ``row``: the row of the event;
    - ``state``: a code of the measured quantity c, see below;
    - C: the filter's prediction of c; G, W: the score and the information of c;
    - K: the covariance (6,) of x and c. The update is x ← x + K G.

    With ``keep`` ≥ 2, it also stores X (N, 6): the state after each row. With ``keep`` ≥ 3, X
    (N, 9) has three more columns: ``loglik`` up to each row.

    An event measures the reading of one encoder. If this reading has risen or fallen by one count,
    a second event may measure the rate (rad/s) at which it rises or falls. The codes are:

        0, 1, 2   c is the reading of roll, pitch, yaw
        3, 4, 5   c is the rate of the roll, pitch, yaw reading, which has risen
        6, 7, 8   c is the rate of the roll, pitch, yaw reading times −1; the reading has fallen
    """
    N = V.shape[0]
    target, F = np.empty((N, 2)), np.empty((N, 2))
    x, P, A = np.empty(6), np.empty((6, 6)), np.empty((3, 6))
    work = np.empty((3, 6))
    m, slope, w = np.empty(3), np.empty(3), np.zeros((8, 3))
    column, cache = np.empty(6), np.full(6, -1.0)
    last, logZ0 = np.empty(3), np.zeros(3)
    encoder_effects, dry = first[MEASURE + 1] > first[MEASURE], first[DRY + 1] > first[DRY]
    E = 0
    for b in range(blocks.shape[0]):
        s = s0.copy()
        mem = mem0.copy()
        axes = free[b]
        setup(s, first, address, par, mem)
        s[STEPPED] = 1.0
        lead, start, stop = blocks[b, 0], blocks[b, 1], blocks[b, 2]
        thrusts(s, V, h, lead, stop, first, address, par, mem, target, F)
        cache[0] = -1.0
        P[:, :] = 0.0
        for i in range(3):
            x[i] = y[start, i] if y[start, i] == y[start, i] else 0.0
            x[3 + i] = 0.0
            last[i] = y[start, i]
            logZ0[i] = 0.0
            s[FLANK + i] = 0.0
        readings(s, x, first, address, par, mem, m, slope)
        for i in range(3):
            x[i] -= (m[i] - x[i]) / slope[i]
        driven = a2 * axes  # an axis that cannot move has no process noise
        for i in range(3):
            gap = 0.0
            if encoder_effects:
                rising, falling, _ = flanks(s, x, i, first, address, par, mem, m, slope)
                gap = falling - rising
            if axes[i]:
                unit = slope[i] * slope[i]
                P[i, i] = (grid[b, i] ** 2 if grid[b, i] > 0.0 else 12.0 * R2[i]) + gap * gap
                P[i, i] /= 12.0 * unit
                P[3 + i, 3 + i] = RATE_0**2 / unit
                driven[i] /= unit
        since = 1e9
        for k in range(start, stop):
            for i in range(3):
                if y[k, i] != y[k, i] or not axes[i]:
                    continue
                D = grid[b, i]
                change = y[k, i] - last[i]
                last[i] = y[k, i]
                at, scale, gap = x[i], 1.0, 0.0
                rising = falling = x[i]
                if encoder_effects:
                    rising, falling, scale = flanks(s, x, i, first, address, par, mem, m, slope)
                    if D > 0.0 and abs(change) < 0.5 * D:
                        at, gap = 0.5 * (rising + falling), falling - rising
                    else:
                        at = rising if change > 0.0 else falling
                v = scale * x[3 + i]
                S = scale * scale * P[i, i] + jitter * jitter * v * v
                e = y[k, i] - at
                rate = 0.0
                if D == 0.0:
                    S += R2[i]
                    logZ = -0.5 * (e * e / S + math.log(2.0 * math.pi * S))
                    g, info = e / S, 1.0 / S
                elif abs(change) < 0.5 * D:
                    # Either side of the backlash may be the one near an encoder edge.
                    half = 0.5 * (D + gap)
                    room = half - abs(e)
                    if room > 0.0 and room * room > 1.5 * S:
                        continue
                    S += R2[i]
                    logZ, g, info = interval(e - half, e + half, S)
                    if logZ - logZ0[i] > LOG_UPDATE_RATIO:
                        continue
                    logZ -= logZ0[i]
                    at = falling if g > 0.0 else rising  # the side near an encoder edge
                    left = max(S * (1.0 - S * info), 1e-6 * S)
                    logZ0[i] = interval(e - S * g - half, e - S * g + half, left)[0]
                else:
                    rate = 1.0 if change > 0.0 else -1.0
                    speed = abs(scale * x[3 + i]) * h[k]
                    if abs(change) < 1.5 * D and speed < 0.5 * D:
                        e += rate * 0.5 * (speed - D)
                        S += R2[i] + speed * speed / 12.0
                        logZ = -0.5 * (e * e / S + math.log(2.0 * math.pi * S)) - logZ0[i]
                        g, info = e / S, 1.0 / S
                    else:
                        rate = 0.0
                        S += R2[i]
                        logZ, g, info = interval(e - 0.5 * D, e + 0.5 * D, S)
                    logZ0[i] = 0.0
                loglik[i] += logZ
                apply_event(x, P, i, scale, g, info, column)
                if keep >= 1:
                    row[E], state[E], C[E], G[E], W[E] = k, i, at, g, info
                    K[E] = column
                E += 1
                if rate != 0.0:
                    scale *= rate
                    at = scale * x[3 + i]
                    logZ, g, info = rate_event(at, scale * scale * P[3 + i, 3 + i])
                    loglik[i] += logZ + math.log(h[k])
                    apply_event(x, P, 3 + i, scale, g, info, column)
                    if keep >= 1:
                        up = 3 + i if rate > 0.0 else 6 + i
                        row[E], state[E], C[E], G[E], W[E] = k, up, at, g, info
                        K[E] = column
                    E += 1
            if keep >= 2:
                X[k, :6] = x
            if keep >= 3:
                X[k, 6:] = loglik
            if k + 1 < stop:
                if since >= RELINEARISE_S:
                    since = 0.0
                    s[T] = t[k]
                    linearise(s, x, F[k], first, address, par, mem, axes, w, A)
                since += h[k]
                midpoint_without_dry_friction(
                    s, x, k, t, h, V, target, F, first, address, par, mem, axes, w, cache
                )
                propagate_covariance(P, A, h[k], driven, work)
                if dry:
                    for i in range(3):
                        w[3, i] = math.sqrt(P[3 + i, 3 + i])
                    if apply_dry_friction(s, x, h[k], first, address, par, mem, axes, w):
                        apply_friction_to_covariance(P, h[k], w, column)
    return E


@dataclass(frozen=True, eq=False)
class FilterRun:
    """The result of one run of the Kalman filter over the data, with E measurement updates."""

    loglik: np.ndarray
    """(3,) log-likelihood by axis: Σ ln L. L is the likelihood of one update, given the earlier
    readings"""
    row: np.ndarray
    """(E,) data row of each update"""
    state: np.ndarray
    """(E,) code of the quantity that each update measures. 0, 1, 2: the reading of roll, pitch,
    yaw. 3, 4, 5: the rate at which the reading of roll, pitch, yaw rises. 6, 7, 8: the rate at
    which the reading of roll, pitch, yaw falls"""
    c: np.ndarray
    g: np.ndarray
    w: np.ndarray
    """(E,) each: predicted measured quantity c, score g = ∂ln L/∂c, information w = −∂²ln L/∂c²"""
    K: np.ndarray
    """(E, 6) covariance between the state and c at each update. The update adds K g to the state"""
    X: np.ndarray | None
    """(N, 6) states after each row: angles (rad), rates (rad/s). (N, 9) with the sum Σ ln L of each
    axis up to the row in the last three columns. None if not kept"""


def filter_quantised(
    structure: Structure,
    values: np.ndarray,
    data: Data,
    noise: np.ndarray,
    encoder_noise: np.ndarray,
    *,
    keep: int = 1,
) -> FilterRun:
    """Return the filter's run over ``data`` with the parameters ``values`` (n,) of ``structure``.

    The first three elements of ``noise`` (4,) are the process noise on roll, pitch and yaw
    (rad/s²/√Hz). The fourth is the sampling jitter (s). ``encoder_noise`` (3,) rad² is the variance
    of the angle at which an encoder's reading switches. For readings that are not quantised, it is
    the variance of their noise. ``keep`` selects what the result contains:

    - 0: only the log-likelihood
    - 1: also the quantities of each measurement update
    - 2: also the states X
    - 3: also the log-likelihood up to each row, as further columns of X
    """
    N = len(data.t)
    n = 6 * N if keep else 1
    row, state = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    c, g, w, K = np.empty(n), np.empty(n), np.empty(n), np.empty((n, 6))
    X = np.zeros((N if keep >= 2 else 1, 9 if keep >= 3 else 6))
    loglik = np.zeros(3)
    E = filter_blocks(
        *structure.arguments(values), data.blocks, data.free, data.grid, data.t, data.h, data.V,
        data.y, np.asarray(noise[:3], dtype=float) ** 2, float(noise[3]),
        encoder_noise, keep, loglik, row, state, c, g, w, K, X,
    )  # fmt: skip
    if not keep:
        E = 0
    lost = ~(np.isfinite(c[:E]) & np.isfinite(g[:E]) & np.isfinite(w[:E]))
    return FilterRun(
        np.where(np.isfinite(loglik), loglik, -np.inf), row[:E].copy(), state[:E].copy(),
        c[:E].copy(), np.where(lost, 0.0, g[:E]), np.where(lost, 0.0, w[:E]),
        K[:E].copy(), X if keep >= 2 else None,
    )  # fmt: skip


@partial(compiled, error_model="numpy", nogil=True)
def prediction_changes(  # type: ignore[no-untyped-def]
    s0, first, address, pars, mem0, blocks, free, t, h, V, y, row, state, C, G, W, K, D
):  # fmt: skip
    """Compute how J sets of parameters change what the Kalman filter predicts at its E updates.

    `filter_blocks` has filtered the data and stored its measurement updates (events) in row, state,
    C, G, W, K. An event measures one quantity: an encoder reading or a rate. `filter_blocks` has
    predicted C (E,) for the quantities. This function repeats the filter's pass for each parameter
    set. It predicts the same quantities, subtracts C, and writes the differences to D (J, E).

    In the repeated pass, each event changes the state by K (G − W D), with the stored K, G and W.
    K is the covariance between the state and the quantity. G is the score of the quantity, W its
    information. ``s0`` and ``pars`` are the arrays s and par of `Structure.arguments` for the J
    parameter sets. The other arguments are those of `filter_blocks`.

    In `filter_blocks`, dry friction depends on the uncertainty of the rates; here it does not. So D
    is not zero even for the parameters with which `filter_blocks` ran. Therefore, pass these as the
    first set, and subtract the first row of D from the others.
    """
    N, E = V.shape[0], row.shape[0]
    encoder_effects = first[MEASURE + 1] > first[MEASURE]
    target, F = np.empty((N, 2)), np.empty((N, 2))
    x = np.empty(6)
    m, slope, w = np.empty(3), np.ones(3), np.zeros((8, 3))
    cache, last = np.full(6, -1.0), np.empty(3)
    own, ratio = np.ones((blocks.shape[0], 3)), np.ones(3)
    for v in range(s0.shape[0]):
        par = pars[v]
        n = 0
        for b in range(blocks.shape[0]):
            s = s0[v].copy()
            mem = mem0.copy()
            axes = free[b]
            setup(s, first, address, par, mem)
            lead, start, stop = blocks[b, 0], blocks[b, 1], blocks[b, 2]
            thrusts(s, V, h, lead, stop, first, address, par, mem, target, F)
            cache[0] = -1.0
            for i in range(3):
                x[i] = y[start, i] if y[start, i] == y[start, i] else 0.0
                x[3 + i] = 0.0
                s[FLANK + i] = 0.0
                last[i] = y[start, i]
            readings(s, x, first, address, par, mem, m, slope)
            for i in range(3):
                x[i] -= (m[i] - x[i]) / slope[i]
                if v == 0:
                    own[b, i] = slope[i]
                ratio[i] = own[b, i] / slope[i]
            for k in range(start, stop):
                while n < E and row[n] == k:
                    c = state[n]
                    if c < 3 and not encoder_effects:
                        d = x[c] - C[n]
                    elif c < 3:
                        change = y[k, c] - last[c]
                        rising, falling, _ = flanks(s, x, c, first, address, par, mem, m, slope)
                        if abs(change) < STILL:
                            change = -G[n]
                        d = (rising if change > 0.0 else falling) - C[n]
                    elif c < 6:
                        d = slope[c - 3] * x[c] - C[n]
                    else:
                        d = -slope[c - 6] * x[c - 3] - C[n]
                    D[v, n] = d
                    g = G[n] - W[n] * d
                    for j in range(6):
                        x[j] += K[n, j] * g * ratio[j % 3]
                    n += 1
                if encoder_effects:
                    for i in range(3):
                        if y[k, i] == y[k, i]:
                            last[i] = y[k, i]
                if k + 1 < stop:
                    step_midpoint(
                        s, x, k, t, h, V, target, F, first, address, par, mem, axes, w, cache
                    )
