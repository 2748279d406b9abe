"""Compute free-run predictions over several horizons, and their variances.

`predict_free_run` starts each prediction from a state of the filter. It simulates in steps h of at
most 20 ms (`integrator.mean_thrust_step`). q are the angles (rad), F̄ is the exact mean of the
thrusts F (N) in a step, q̈ (rad/s²) the acceleration at the middle of the step:

    F̄ = (1/h) ∫ F dt,      q ← q + h q̇ + h²/2 q̈,      q̇ ← q̇ + h q̈

`prediction_variances` propagates the covariance P of the states x (angles and rates), as the filter
`heli3dof.model.estimation.ekf_quantised` does. Each update of this filter is a measurement of one
state x_i, an angle or a rate. ln L is the measurement's log-likelihood as a function of the
predicted x_i. A run of the filter gives K_i, the variance of x_i before the update, and
w = −∂² ln L/∂x_i². A measurement with Gaussian noise of variance R would give w = 1/(K_i + R). So
`prediction_variances` replaces each update by that of a linear Kalman filter with this R (P_i:
column i of P, P_ii: its diagonal element):

    R = 1/w − K_i,      P ← P − P_i P_iᵀ/(P_ii + R)
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from heli3dof.model.compiled import compiled
from heli3dof.model.estimation.ekf_quantised import propagate_covariance
from heli3dof.model.greybox.prediction import STEP_S
from heli3dof.model.physics.integrator import mean_thrust_step, readings, setup
from heli3dof.model.physics.state_layout import T

STEP_DECAYS, MAX_STEPS = 0.5, 1000.0
"""Longest step of the covariance, in units of the fastest time constant. At most `MAX_STEPS` steps
are used, even if they are longer than that. Chosen."""


@partial(compiled, error_model="numpy", nogil=True)
def predict_free_run(  # type: ignore[no-untyped-def]
    s0, first, address, par, mem0, blocks, free, t, V, thrust_integral, X, starts, rows, out
):
    """Write the predicted encoder readings (rad) to ``out`` (S, H, 3).

    S predictions start at the rows ``starts`` (S,), each from the state of its row in X (N, 6).
    ``rows`` (H,) contains the H horizons, as numbers of rows. Both arrays are sorted, smallest
    element first. ``thrust_integral`` (N + 1, 2): time integral of both thrusts up to each row,
    computed separately for each of the ``blocks`` (intervals of usable rows) by
    `prediction.impulse`. A reading is NaN if its row is beyond the block in which the prediction
    starts. It is infinite if the prediction diverged.
    """
    x, w, m, slope = np.empty(6), np.zeros((3, 3)), np.empty(3), np.empty(3)
    at = 0
    for b in range(blocks.shape[0]):
        s = s0.copy()
        mem = mem0.copy()
        axes, stop = free[b], blocks[b, 2]
        setup(s, first, address, par, mem)
        while at < starts.shape[0] and starts[at] < stop:
            a = starts[at]
            for j in range(6):
                x[j] = X[a, j]
            for n in range(rows.shape[0]):
                end = starts[at] + rows[n]
                for i in range(3):
                    out[at, n, i] = np.nan
                if end >= stop:
                    continue
                while a < end:
                    c = a + 1
                    while c < end and t[c + 1] - t[a] <= STEP_S:
                        c += 1
                    d = t[c] - t[a]
                    s[T] = t[a]
                    mean_thrust_step(
                        s, x, a, c, d, thrust_integral, V, first, address, par, mem, axes, w
                    )
                    a = c
                readings(s, x, first, address, par, mem, m, slope)
                for i in range(3):
                    out[at, n, i] = m[i] if math.isfinite(m[i]) else np.inf
            at += 1


@partial(compiled, error_model="numpy", nogil=True)
def grow_stably(P, A, d, a2, work):  # type: ignore[no-untyped-def]
    """Propagate the covariance P (6, 6) over ``d`` seconds by `ekf_quantised.propagate_covariance`.

    The steps are short where a rate decays fast, as by dry friction near rest.
    """
    fastest = 0.0
    for i in range(3):
        for j in range(3):
            fastest = max(fastest, abs(A[i, 3 + j]))
    steps = 1 + int(min(d * fastest / STEP_DECAYS, MAX_STEPS))
    for _ in range(steps):
        propagate_covariance(P, A, d / steps, a2, work)


@partial(compiled, error_model="numpy", nogil=True)
def prediction_variances(  # type: ignore[no-untyped-def]
    blocks, free, t, h, A, slope, row, state, W, K, a2, P0, starts, rows, out
):
    """Write the variances (rad²) of the predicted angles to ``out``: S starts, H horizons, 3 axes.

    P0 (B, 6): variances of the states at the start of each of the B ``blocks`` (intervals of usable
    rows).
    """
    P, Q, column = np.empty((6, 6)), np.empty((6, 6)), np.empty(6)
    work = np.empty((3, 6))
    n, at = 0, 0
    for b in range(blocks.shape[0]):
        start, stop = blocks[b, 1], blocks[b, 2]
        P[:, :] = 0.0
        for i in range(6):
            P[i, i] = P0[b, i]
        driven = a2 * free[b]
        for k in range(start, stop):
            while n < row.shape[0] and row[n] == k:
                c = state[n]
                sign = 1.0
                if c >= 6:
                    c -= 3
                    sign = -1.0
                scale = sign * slope[k, c % 3]
                if W[n] > 0.0:
                    R = max(1.0 / W[n] - scale * K[n, c], 0.0)
                    for j in range(6):
                        column[j] = scale * P[j, c]
                    S = scale * column[c] + R
                    for i in range(6):
                        for j in range(6):
                            P[i, j] -= column[i] * column[j] / S
                n += 1
            if at < starts.shape[0] and starts[at] == k:
                for i in range(6):
                    for j in range(6):
                        Q[i, j] = P[i, j]
                a = k
                for m in range(rows.shape[0]):
                    end = k + rows[m]
                    for i in range(3):
                        out[at, m, i] = np.nan
                    if end >= stop:
                        continue
                    while a < end:
                        c = a + 1
                        while c < end and t[c + 1] - t[a] <= STEP_S:
                            c += 1
                        grow_stably(Q, A[a], t[c] - t[a], driven, work)
                        a = c
                    for i in range(3):
                        out[at, m, i] = Q[i, i]
                at += 1
            if k + 1 < stop:
                grow_stably(P, A[k], h[k], driven, work)
