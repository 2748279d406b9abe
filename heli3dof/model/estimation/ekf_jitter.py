"""Extended Kalman filter for logs with sampling jitter, and for parameters that vary by recording.

Sample k is taken δ_k (s) after its time stamp, δ_k white with standard deviation σ_t. The reading
of axis i with the encoder step Δ_i is

    y_i[k] = m_i(x_k) + ṁ_i δ_k + ε_i,       ε_i white of variance Δ_i²/12

m_i is the ideal reading in state x_k, ṁ_i its rate. δ_k is common to the axes, so their errors are
correlated. The filter adds δ_k as a state without memory and processes the three readings one after
the other. This is the exact update with the joint covariance diag(Δ²/12) + σ_t² ṁ ṁᵀ. In contrast,
`heli3dof.model.estimation.ekf_quantised` uses encoder edges (angles at which a reading changes) and
treats the axes' jitter as independent. `ekf_quantised` is more accurate if the clock is accurate.

The filter also estimates effect parameters b that are constant within a recording and differ
between recordings. An example is the angle at which an encoder was switched on. The state is
x = (q, q̇, b), where q are the angles. As b is constant, its rate of change in the model is zero. At
the start of each run (interval of usable rows), b has the distribution N(b_0, σ_b²). The covariance
P of x advances as in `heli3dof.model.estimation.ekf_quantised`, except for this:

* The transition matrix contains ∂q̈/∂(q, q̇, b), and terms of second order in the sample interval h.
* Dry friction changes x only, not P.
* The process noise is that of the true angle. It does not change if an encoder has a scale error,
  that is, if its reading is a multiple of the true angle.

x advances by the midpoint rule. The rule's error per sample interval is h³ q⃛/24, a thousandth of
an encoder step.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from heli3dof.model.compiled import compiled, inlined
from heli3dof.model.estimation.ekf_quantised import RATE_0, RELINEARISE_S, linearise
from heli3dof.model.estimation.filter_data import Data
from heli3dof.model.physics import state_layout as _s
from heli3dof.model.physics.integrator import readings, setup, step_midpoint
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.model.physics.rigid_body import accelerations
from heli3dof.model.physics.rotor import thrusts

T, F_FRONT, F_BACK, STEPPED = _s.T, _s.F_FRONT, _s.F_BACK, _s.STEPPED
DIFFERENCE_STEP = 1e-6
"""Step of the finite differences with respect to b, in the unit of b."""


@inlined
def place(par, where, q, value):  # type: ignore[no-untyped-def]
    """Set the parameter with the index q to ``value``, at all its positions in ``par``.

    ``where`` (W, 3): the result of `positions` for the parameters that differ between recordings.
    """
    for z in range(where.shape[0]):
        if where[z, 2] == q:
            par[where[z, 0], where[z, 1]] = value


@partial(compiled, error_model="numpy")
def _slopes(s, x, F, first, address, par, mem, free, where, w, A):  # type: ignore[no-untyped-def]
    """Write the derivatives ∂q̈/∂x (3, 6 + B) of the accelerations q̈ at the state x to A.

    x contains the angles, the rates and the B parameters that vary by recording; ``where`` is their
    `positions` in ``par``. F (2,) N are the thrusts, w work space. For the other arguments see
    `heli3dof.model.physics.integrator`.
    """
    linearise(s, x, F, first, address, par, mem, free, w, A)
    for j in range(6, A.shape[1]):
        s[F_FRONT], s[F_BACK] = F[0], F[1]
        place(par, where, j - 6, x[j] + DIFFERENCE_STEP)
        accelerations(s, first, address, par, mem, free, w[0], w[1], w[3])
        place(par, where, j - 6, x[j])
        for i in range(3):
            A[i, j] = (w[3, i] - w[2, i]) / DIFFERENCE_STEP


@partial(compiled, error_model="numpy")
def _propagate(P, A, h, a2, AP, W, n):  # type: ignore[no-untyped-def]
    """Advance the covariance P (n, n) of the state x by one step of h s, in place.

    x = (q, q̇, b): angles, rates and B parameters that vary by recording, n = 6 + B. P ← Φ P Φᵀ +
    process noise of intensity a2 (3,) on the rates, as in `ekf_quantised`. With A (3, n) = ∂q̈/∂x,
    Φ maps x to (q + h q̇ + ½h² A x, q̇ + h A x, b). ``AP`` and ``W`` (n, n) are work space.
    """
    half = 0.5 * h * h
    for i in range(3):
        for j in range(n):
            acc = 0.0
            for z in range(n):
                acc += A[i, z] * P[z, j]
            AP[i, j] = acc
    for j in range(n):
        for i in range(3):
            W[i, j] = P[i, j] + h * P[3 + i, j] + half * AP[i, j]
            W[3 + i, j] = P[3 + i, j] + h * AP[i, j]
        for i in range(6, n):
            W[i, j] = P[i, j]
    for i in range(n):
        for j in range(min(i + 1, 3)):
            acc = 0.0
            for z in range(n):
                acc += W[i, z] * A[j, z]
            P[i, j] = W[i, j] + h * W[i, 3 + j] + half * acc
            P[j, i] = P[i, j]
            if 3 + j <= i:
                P[i, 3 + j] = W[i, 3 + j] + h * acc
                P[3 + j, i] = P[i, 3 + j]
        for j in range(6, i + 1):
            P[i, j] = W[i, j]
            P[j, i] = P[i, j]
    for i in range(3):
        P[i, i] += a2[i] * h * h * h / 3.0
        P[i, 3 + i] += a2[i] * h * h / 2.0
        P[3 + i, i] = P[i, 3 + i]
        P[3 + i, 3 + i] += a2[i] * h


@partial(compiled, error_model="numpy", nogil=True)
def _filter(  # type: ignore[no-untyped-def]
    s0, first, address, par0, mem0, where, b_std, blocks, free, t, h, V, y, a2, jitter, R2,
    loglik, X,
):  # fmt: skip
    """Filter all blocks: write the states to X (N, 6 + B) and log-likelihoods to ``loglik`` (3,).

    Row k of X is the state estimate after the filter has used the readings of row k. It contains
    three angles, three rates and the B parameters b that vary by recording. ``loglik`` has a value
    per axis. Input:

    - ``s0``, ``first``, ``address``, ``par0``, ``mem0``: the model (`Structure.arguments`)
    - ``where`` (W, 3): the positions of b in ``par0`` (`positions`)
    - ``b_std`` (B,): prior standard deviations σ_b
    - ``blocks``, ``free``, ``t``, ``h``, ``V``, ``y``: the fields of `Data`
    - ``a2`` (3,): process noise, (rad/s²)²/Hz
    - ``jitter``: standard deviation σ_t (s) of the sampling instants
    - ``R2`` (3,): variance of the readings, rad²
    """
    N, B = V.shape[0], b_std.shape[0]
    n = 6 + B
    L = n  # the index of δ
    target, F = np.empty((N, 2)), np.empty((N, 2))
    x, P = np.empty(n + 1), np.zeros((n + 1, n + 1))
    A, AP, W = np.empty((3, n)), np.empty((n, n)), np.empty((n, n))
    m, slope, w = np.empty(3), np.empty(3), np.zeros((8, 3))
    m_b, PH, ignored = np.empty((B, 3)), np.empty(n + 1), np.empty(3)
    q_0, rate, cache = np.empty(3), np.empty(3), np.full(6, -1.0)
    for block in range(blocks.shape[0]):
        s, mem, par = s0.copy(), mem0.copy(), par0.copy()
        axes = free[block]
        setup(s, first, address, par, mem)
        s[STEPPED] = 1.0
        lead, start, stop = blocks[block, 0], blocks[block, 1], blocks[block, 2]
        thrusts(s, V, h, lead, stop, first, address, par, mem, target, F)
        cache[0] = -1.0
        P[:, :] = 0.0
        for i in range(3):
            x[i] = y[start, i] if y[start, i] == y[start, i] else 0.0
            x[3 + i] = 0.0
            if axes[i]:
                P[3 + i, 3 + i] = RATE_0**2
        for q in range(where.shape[0]):
            x[6 + where[q, 2]] = par0[where[q, 0], where[q, 1]]
        for q in range(B):
            P[6 + q, 6 + q] = b_std[q] ** 2
        readings(s, x, first, address, par, mem, m, slope)
        for i in range(3):
            x[i] -= (m[i] - x[i]) / slope[i]
            if axes[i]:
                P[i, i] = 100.0 * R2[i]
        # The uncertainty of b makes the initial angles uncertain, and correlated with b.
        for q in range(B):
            place(par, where, q, x[6 + q] + DIFFERENCE_STEP)
            readings(s, x, first, address, par, mem, m_b[q], ignored)
            place(par, where, q, x[6 + q])
            readings(s, x, first, address, par, mem, m, slope)
            for i in range(3):
                if axes[i]:
                    P[i, i] += ((m_b[q, i] - m[i]) / DIFFERENCE_STEP / slope[i] * b_std[q]) ** 2
                    P[i, 6 + q] = -(m_b[q, i] - m[i]) / DIFFERENCE_STEP / slope[i] * b_std[q] ** 2
                    P[6 + q, i] = P[i, 6 + q]
        driven = a2 * axes
        since = 1e9
        for k in range(start, stop):
            for q in range(where.shape[0]):
                par[where[q, 0], where[q, 1]] = x[6 + where[q, 2]]
            readings(s, x, first, address, par, mem, m, slope)
            for q in range(B):
                place(par, where, q, x[6 + q] + DIFFERENCE_STEP)
                readings(s, x, first, address, par, mem, m_b[q], ignored)
                place(par, where, q, x[6 + q])
                for i in range(3):
                    m_b[q, i] = (m_b[q, i] - m[i]) / DIFFERENCE_STEP
            P[L] = 0.0
            P[:, L] = 0.0
            P[L, L] = jitter * jitter
            q_0[:] = x[:3]
            for i in range(3):
                rate[i] = slope[i] * x[3 + i]
            x[L] = 0.0
            for i in range(3):
                if y[k, i] != y[k, i] or not axes[i]:
                    continue
                # A reading depends on its angle, δ and b alone: the rest of H is zero.
                H_q, H_L = slope[i], rate[i]
                at = m[i] + H_q * (x[i] - q_0[i]) + H_L * x[L]
                for q in range(B):
                    for z in range(where.shape[0]):
                        if where[z, 2] == q:
                            at += m_b[q, i] * (x[6 + q] - par[where[z, 0], where[z, 1]])
                            break
                for j in range(n + 1):
                    acc = P[j, i] * H_q + P[j, L] * H_L
                    for q in range(B):
                        acc += P[j, 6 + q] * m_b[q, i]
                    PH[j] = acc
                S = R2[i] + H_q * PH[i] + H_L * PH[L]
                for q in range(B):
                    S += m_b[q, i] * PH[6 + q]
                e = y[k, i] - at
                loglik[i] -= 0.5 * (e * e / S + math.log(2.0 * math.pi * S))
                for j in range(n + 1):
                    gain = PH[j] / S
                    x[j] += gain * e
                    for z in range(j + 1):
                        P[j, z] -= gain * PH[z]
                        P[z, j] = P[j, z]
            X[k] = x[:n]
            if k + 1 == stop:
                continue
            for q in range(where.shape[0]):
                par[where[q, 0], where[q, 1]] = x[6 + where[q, 2]]
            if since >= RELINEARISE_S:
                since = 0.0
                s[T] = t[k]
                _slopes(s, x, F[k], first, address, par, mem, axes, where, w, A)
            since += h[k]
            step_midpoint(s, x, k, t, h, V, target, F, first, address, par, mem, axes, w, cache)
            _propagate(P, A, h[k], driven, AP, W, n)


@dataclass(frozen=True, eq=False)
class FilterResult:
    """The result of `filter_jittered`: estimated states of N rows, and log-likelihood by axis."""

    states: np.ndarray
    """(N, 6 + B), estimated (q, q̇, b) after each row's readings; NaN in rows outside all blocks."""
    loglik: np.ndarray
    """(3,), log-likelihood of the readings of roll, pitch, yaw."""


def filter_jittered(
    structure: Structure,
    values: np.ndarray,
    data: Data,
    noise: np.ndarray,
    varying: Mapping[str, float] | None = None,
) -> FilterResult:
    """Return the states and log-likelihood of ``data`` by the Kalman filter for sampling jitter.

    ``values`` (n,) are the parameters of ``structure``. The first three elements of ``noise`` (4,)
    are the process noise on roll, pitch and yaw (rad/s²/√Hz). The fourth is the sampling jitter
    (s). The filter can also estimate parameters that differ between recordings. ``varying``
    contains their names, each with its prior standard deviation. These estimates start again in
    each run (interval of usable rows).
    """
    varying = varying or {}
    X = np.full((len(data.t), 6 + len(varying)), np.nan)
    loglik = np.zeros(3)
    _filter(
        *structure.arguments(values), positions(structure, tuple(varying)),
        np.array(list(varying.values()), dtype=float), data.blocks, data.free, data.t, data.h,
        data.V, data.y, np.asarray(noise[:3], dtype=float) ** 2, float(noise[3]),
        data.rad_per_count**2 / 12, loglik, X,
    )  # fmt: skip
    return FilterResult(X, loglik)


def positions(structure: Structure, names: tuple[str, ...]) -> np.ndarray:
    """Return where the values of the parameters ``names`` are stored in the array ``par``.

    ``par``, an argument of the compiled filters, has one row for each function of the effects. An
    effect with several functions has its parameters in several rows. The result (W, 3) int64 has a
    row for each stored value: the row of ``par``, the column of ``par``, the parameter's index in
    ``names``.
    """
    out = []
    at = 4
    for i, term in enumerate(structure.terms):
        for column in range(len(term.effect.parameters)):
            name = structure.names[at]
            at += 1
            if name in names:
                out += [
                    (hook, _s.A + column, names.index(name))
                    for hook, owner in enumerate(structure.hooks.owner)
                    if owner == i
                ]
    return np.array(out, dtype=np.int64).reshape(-1, 3)
