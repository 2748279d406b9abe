"""Compiled loops: compute how an additional torque changes the likelihood, to first order.

The filter's gains are held fixed, and the model is linearised along its states x = (q, q̇), in rad
and rad/s. A small torque τ (N·m) acts during row k, which lasts h seconds. It changes the predicted
x by δx = (δq, δq̇):

    δq̈ = A δx + B τ,    A = ∂q̈/∂(q, q̇) (3, 6),   B = M(q)⁻¹ (3, 3)
    δq ← δq + h δq̇ + h²/2 δq̈,     δq̇ ← δq̇ + h δq̈             from row to row
    δc = s δx_i,  δx ← δx − K w δc                             at each event

An event is an update of the filter by an encoder reading (`heli3dof.model.estimation.ekf_quantised`
defines its symbols). c is the predicted value of the measured quantity, usually the reading itself.
x_i is the state on which c depends, and s = ∂c/∂x_i. g = ∂ ln L/∂c is the score, with the
likelihood L. w = −∂² ln L/∂c² is the information, and K is the covariance of x and c. The reading
updates the state by K g.

To first order, a torque changes ln L by Σ g δc, summed over all events. `gradient` computes
ν_k = ∂ ln L/∂τ_k for each row and axis by one backward pass (adjoint method). A torque with the
time course f_k then has the score Σ f_k ν_k. `sum_hat_scores` computes δc of many torques in one
forward pass, and sums their scores and their information.
"""

from __future__ import annotations

import numpy as np

from heli3dof.model.compiled import compiled
from heli3dof.model.estimation.ekf_quantised import linearise
from heli3dof.model.physics import state_layout as _s
from heli3dof.model.physics.integrator import readings, setup
from heli3dof.model.physics.rigid_body import accelerations, body_accelerations
from heli3dof.model.physics.rotor import thrusts

R, T, F_FRONT, F_BACK, V_FRONT, V_BACK = _s.R, _s.T, _s.F_FRONT, _s.F_BACK, _s.V_FRONT, _s.V_BACK


def _linear(  # type: ignore[no-untyped-def]
    s0, first, address, par, mem0, blocks, free, t, h, V, X, A, B, slope, q_ddot
):  # fmt: skip
    """Write the model's derivatives and accelerations at the states X (N, 6) to four arrays.

    ``A`` (N, 3, 6) = ∂q̈/∂(q, q̇), ``B`` (N, 3, 3) = ∂q̈/∂τ, ``slope`` (N, 3) = ∂reading/∂angle,
    ``q_ddot`` (N, 3) in rad/s².
    """
    N = V.shape[0]
    target, F = np.empty((N, 2)), np.empty((N, 2))
    w, m = np.zeros((4, 3)), np.empty(3)
    for b in range(blocks.shape[0]):
        s = s0.copy()
        mem = mem0.copy()
        axes = free[b]
        setup(s, first, address, par, mem)
        lead, start, stop = blocks[b, 0], blocks[b, 1], blocks[b, 2]
        thrusts(s, V, h, lead, stop, first, address, par, mem, target, F)
        lagged = s[_s.TAU_M] > 0.0 or s[_s.SLEW] > 0.0
        for k in range(start, stop):
            readings(s, X[k], first, address, par, mem, m, slope[k])
            now = F if lagged else target
            s[T] = t[k]
            s[V_FRONT], s[V_BACK] = V[k, 0], V[k, 1]
            for i in range(6):
                s[R + i] = X[k, i]
            s[F_FRONT], s[F_BACK] = now[k, 0], now[k, 1]
            accelerations(s, first, address, par, mem, axes, w[0], w[1], w[2])
            for i in range(3):
                q_ddot[k, i] = w[2, i]
                w[1, i] += 1.0
                body_accelerations(s, w[0], w[1], axes, w[3])
                w[1, i] -= 1.0
                for j in range(3):
                    B[k, j, i] = w[3, j] - w[2, j]
            linearise(s, X[k], now[k], first, address, par, mem, axes, w, A[k])


linear = compiled(_linear, error_model="numpy", nogil=True)


def _gradient(blocks, h, A, B, slope, row, state, G, W, K, nu, mu):  # type: ignore[no-untyped-def]
    """Write the derivatives of the log-likelihood ln L with respect to torques and accelerations.

    ``nu`` (N, 3) = ∂ ln L/∂τ_k for the torques τ_k (N·m), ``mu`` (N, 3) = ∂ ln L/∂q̈_k for the
    accelerations q̈_k (rad/s²). τ_k and q̈_k act from the sample of row k to that of row k + 1, and
    are constant in this interval.
    """
    n = row.shape[0] - 1
    z, acc = np.empty(6), np.empty(3)
    for b in range(blocks.shape[0] - 1, -1, -1):
        start, stop = blocks[b, 1], blocks[b, 2]
        z[:] = 0.0
        for k in range(stop - 1, start - 1, -1):
            if k + 1 < stop:
                for i in range(3):
                    acc[i] = 0.5 * h[k] * h[k] * z[i] + h[k] * z[3 + i]
                    mu[k, i] = acc[i]
                for i in range(3):
                    nu[k, i] = B[k, 0, i] * acc[0] + B[k, 1, i] * acc[1] + B[k, 2, i] * acc[2]
                for i in range(3):
                    z[3 + i] += h[k] * z[i]
                for j in range(6):
                    z[j] += A[k, 0, j] * acc[0] + A[k, 1, j] * acc[1] + A[k, 2, j] * acc[2]
            while n >= 0 and row[n] == k:
                c = state[n]
                if c < 3:
                    scale = slope[k, c]
                elif c < 6:
                    scale = slope[k, c - 3]
                else:
                    c -= 3
                    scale = -slope[k, c - 3]
                feedback = 0.0
                for j in range(6):
                    feedback += K[n, j] * z[j]
                z[c] += scale * (G[n] - W[n] * feedback)
                n -= 1


gradient = compiled(_gradient, error_model="numpy", nogil=True)


def _sum_hat_scores(  # type: ignore[no-untyped-def]
    blocks, h, A, B, slope, row, state, G, W, K, left, share, tangents, axes, knots,
    score, information, cross, sensitivities,
):  # fmt: skip
    """Sum the scores and the information of J torque coefficients (N·m) over E encoder readings.

    The torque on each of ``axes`` is a piecewise linear function of each of M variables. Such a
    function is a sum of hat (triangular) functions times coefficients; it has one hat function for
    each of its ``knots``. So J is (number of axes) · M · ``knots``, and a group is the
    coefficients of one axis and one variable. Arguments:

    - ``left`` (N, M): index of the knot below the variable's value in each of N rows
    - ``share`` (N, M): position of the value between this knot (0) and the next one (1)
    - ``tangents`` (n, E): derivatives of the predicted readings with respect to n other parameters

    Results, written to the last four arguments:

    - ``score`` (J,): derivatives of the log-likelihood with respect to the coefficients
    - ``information`` (groups, knots, knots): Fisher information of the coefficients in each group
    - ``cross`` (n, J): Fisher information shared by the n other parameters and the coefficients
    - ``sensitivities`` (J, E): derivatives of the predicted readings with respect to the
      coefficients; an array (0, E) if they are not needed
    """
    M = left.shape[1]
    groups = axes.shape[0] * M
    J = groups * knots
    x, acc, dc = np.zeros((6, J)), np.empty((3, J)), np.empty(J)
    n = 0
    for b in range(blocks.shape[0]):
        start, stop = blocks[b, 1], blocks[b, 2]
        x[:, :] = 0.0
        for k in range(start, stop):
            while n < row.shape[0] and row[n] == k:
                c = state[n]
                if c < 3:
                    scale = slope[k, c]
                elif c < 6:
                    scale = slope[k, c - 3]
                else:
                    c -= 3
                    scale = -slope[k, c - 3]
                g, w = G[n], W[n]
                for j in range(J):
                    dc[j] = scale * x[c, j]
                    score[j] += g * dc[j]
                for p in range(tangents.shape[0]):
                    wt = w * tangents[p, n]
                    for j in range(J):
                        cross[p, j] += wt * dc[j]
                for q in range(groups):
                    o = q * knots
                    for i in range(knots):
                        wd = w * dc[o + i]
                        for j in range(i + 1):
                            information[q, i, j] += wd * dc[o + j]
                for p in range(sensitivities.shape[0]):
                    sensitivities[p, n] = dc[p]
                for i in range(6):
                    kw = K[n, i] * w
                    for j in range(J):
                        x[i, j] -= kw * dc[j]
                n += 1
            if k + 1 == stop:
                continue
            hk = h[k]
            for i in range(3):
                for j in range(J):
                    acc[i, j] = (
                        A[k, i, 0] * x[0, j] + A[k, i, 1] * x[1, j] + A[k, i, 2] * x[2, j]
                        + A[k, i, 3] * x[3, j] + A[k, i, 4] * x[4, j] + A[k, i, 5] * x[5, j]
                    )  # fmt: skip
                for a in range(axes.shape[0]):
                    gain = B[k, i, axes[a]]
                    for m in range(M):
                        o = (a * M + m) * knots + left[k, m]
                        acc[i, o] += gain * (1.0 - share[k, m])
                        acc[i, o + 1] += gain * share[k, m]
            for i in range(3):
                for j in range(J):
                    x[i, j] += hk * x[3 + i, j] + 0.5 * hk * hk * acc[i, j]
                    x[3 + i, j] += hk * acc[i, j]
    for q in range(groups):
        for i in range(knots):
            for j in range(i):
                information[q, j, i] = information[q, i, j]


sum_hat_scores = compiled(_sum_hat_scores, error_model="numpy", nogil=True)


def _gather(nu, axes, which, left, share, knots, out):  # type: ignore[no-untyped-def]
    """Add the score Σ_k ν_k φ(z_k) of each of J hat functions φ to ``out`` (blocks, J).

    A hat (triangular) function φ(z) is a torque on one axis that depends on one variable z. z_k is
    the value of z in row k. ν_k is the derivative of the log-likelihood with respect to the torque
    in row k (``nu``, from `_gradient`). The sum is over the rows k of a block; ``which`` (N,) is
    the block number of each row. ``left``, ``share``: as in `_sum_hat_scores`.
    """
    M = left.shape[1]
    for k in range(nu.shape[0]):
        b = which[k]
        for a in range(axes.shape[0]):
            v = nu[k, axes[a]]
            for m in range(M):
                j = (a * M + m) * knots + left[k, m]
                out[b, j] += v * (1.0 - share[k, m])
                out[b, j + 1] += v * share[k, m]


gather = compiled(_gather, error_model="numpy", nogil=True)
