"""The compiled loops of `bias_correction.perturbation`, which explains the equations and symbols.

A, X and ``chunk`` are as in `Path`; h (N,) s are the steps between rows. An event is an update of
the filter with one reading. For E events, ``row`` (E,) are the row numbers, W (E,) the information
of the readings, and K (E, 6) the covariances of state and reading. ``state`` (E,) is the index of
the quantity read: 0–2 an angle, 3–5 a rate, 6–8 a rate with opposite sign.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from heli3dof.model.compiled import compiled
from heli3dof.model.estimation.ekf_quantised import linearise
from heli3dof.model.physics import state_layout as _s
from heli3dof.model.physics.integrator import readings, setup
from heli3dof.model.physics.rigid_body import accelerations
from heli3dof.model.physics.rotor import lagged, thrusts

R, T, F_FRONT, V_FRONT = _s.R, _s.T, _s.F_FRONT, _s.V_FRONT
TAU_M, K_F, GAIN_FRONT, SLEW = _s.TAU_M, _s.K_F, _s.GAIN_FRONT, _s.SLEW


@partial(compiled, error_model="numpy", nogil=True)
def slopes(  # type: ignore[no-untyped-def]
    s0, first, address, par, mem0, blocks, free, t, h, V, chunk, X, A, slope
):  # fmt: skip
    N = V.shape[0]
    target, F = np.empty((N, 2)), np.empty((N, 2))
    w, m = np.zeros((8, 3)), np.empty(3)
    run = -1
    for c in range(chunk.shape[0]):
        b = chunk[c, 2]
        if b != run:
            run = b
            s = s0.copy()
            mem = mem0.copy()
            setup(s, first, address, par, mem)
            thrusts(s, V, h, blocks[b, 0], blocks[b, 2], first, address, par, mem, target, F)
        k = (chunk[c, 0] + chunk[c, 1]) // 2
        s[T] = t[k]
        s[V_FRONT], s[V_FRONT + 1] = V[k, 0], V[k, 1]
        linearise(s, X[c], F[k], first, address, par, mem, free[b], w, A[c])
        if c == 0:
            readings(s, X[c], first, address, par, mem, m, slope)


@partial(compiled, error_model="numpy", nogil=True)
def forcing(  # type: ignore[no-untyped-def]
    sets, first, address, pars, mem0, blocks, free, t, h, V, chunk, X, moves, base, mean, out
):  # fmt: skip
    N, C = V.shape[0], chunk.shape[0]
    target, F = np.empty((N, 2)), np.empty((N, 2))
    w = np.zeros((8, 3))
    s = sets[0].copy()
    mem = mem0.copy()
    for j in range(sets.shape[0]):
        par = pars[j]
        run = -1
        for c in range(C):
            b, lo, hi = chunk[c, 2], chunk[c, 0], chunk[c, 1]
            if b != run:
                run = b
                s = sets[j].copy()
                mem = mem0.copy()
                setup(s, first, address, par, mem)
                if moves[j]:
                    thrusts(
                        s, V, h, blocks[b, 0], blocks[b, 2], first, address, par, mem, target, F
                    )
            if moves[j]:
                tau = s[TAU_M]
                decay = math.exp(-0.5 * h[lo] / tau) if tau > 0.0 else 0.0
                for m in range(2):
                    total = 0.0
                    for k in range(lo, hi):
                        if s[SLEW] > 0.0:
                            slew = s[SLEW] * s[K_F] * s[GAIN_FRONT + m]
                            total += lagged(F[k, m], target[k, m], tau, slew, 0.5 * h[k])
                        else:
                            total += target[k, m] + (F[k, m] - target[k, m]) * decay
                    mean[c, m] = total / (hi - lo)
            k = (lo + hi) // 2
            s[T] = t[k]
            s[V_FRONT], s[V_FRONT + 1] = V[k, 0], V[k, 1]
            for i in range(6):
                s[R + i] = X[c, i]
            for m in range(2):
                s[F_FRONT + m] = mean[c, m] if moves[j] else base[c, m]
            accelerations(s, first, address, par, mem, free[b], w[0], w[1], out[j, c])


@partial(compiled, error_model="numpy", nogil=True)
def misreading(  # type: ignore[no-untyped-def]
    sets, first, address, pars, mem0, blocks, row, state, X, m, m0
):  # fmt: skip
    y, slope = np.empty(3), np.empty(3)
    for j in range(sets.shape[0]):
        s = sets[j].copy()
        mem = mem0.copy()
        setup(s, first, address, pars[j], mem)
        for b in range(blocks.shape[0]):
            readings(s, X[blocks[b, 1]], first, address, pars[j], mem, y, slope)
            for i in range(3):
                m0[j, b, i] = y[i]
        for n in range(row.shape[0]):
            if state[n] < 3:
                readings(s, X[row[n]], first, address, pars[j], mem, y, slope)
                m[j, n] = y[state[n]]


@partial(compiled, error_model="numpy", nogil=True)
def forward(  # type: ignore[no-untyped-def]
    A, chunk, h, blocks, row, state, W, K, slope, a, m, m0, D
):  # fmt: skip
    E = row.shape[0]
    x, acc = np.empty(6), np.empty(3)
    for j in range(a.shape[0]):
        n = 0
        run = -1
        for c in range(chunk.shape[0]):
            if chunk[c, 2] != run:
                run = chunk[c, 2]
                x[:] = 0.0
                for i in range(3):
                    x[i] = -m0[j, run, i] / slope[i]
            last = chunk[c, 1] + 1 if chunk[c, 1] == blocks[run, 2] - 1 else chunk[c, 1]
            for k in range(chunk[c, 0], last):
                while n < E and row[n] <= k:
                    e = state[n]
                    axis = e % 3
                    i = e if e < 6 else e - 3
                    d = (slope[axis] if e < 6 else -slope[axis]) * x[i] + m[j, n]
                    D[j, n] = d
                    d *= W[n]
                    for v in range(6):
                        x[v] -= K[n, v] * d
                    n += 1
                if k == chunk[c, 1]:
                    break
                for i in range(3):
                    total = a[j, c, i]
                    for v in range(6):
                        total += A[c, i, v] * x[v]
                    acc[i] = total
                for i in range(3):
                    x[i] += h[k] * (x[3 + i] + 0.5 * h[k] * acc[i])
                    x[3 + i] += h[k] * acc[i]


@partial(compiled, error_model="numpy", nogil=True)
def backward(  # type: ignore[no-untyped-def]
    A, chunk, h, blocks, row, state, W, K, slope, q, L, mu, z0
):  # fmt: skip
    z, v = np.empty(6), np.empty(3)
    C = chunk.shape[0]
    for j in range(q.shape[0]):
        n = row.shape[0] - 1
        z[:] = 0.0
        for cc in range(C):
            c = C - 1 - cc
            run = chunk[c, 2]
            if chunk[c, 1] == blocks[run, 2] - 1:
                z[:] = 0.0
            k = chunk[c, 1]
            if k != blocks[run, 2] - 1:
                k -= 1
            while k >= chunk[c, 0]:
                if k < chunk[c, 1]:
                    for i in range(3):
                        v[i] = h[k] * (0.5 * h[k] * z[i] + z[3 + i])
                        L[j, c, i] += v[i]
                    for i in range(3):
                        z[3 + i] += h[k] * z[i]
                    for m in range(6):
                        z[m] += v[0] * A[c, 0, m] + v[1] * A[c, 1, m] + v[2] * A[c, 2, m]
                while n >= 0 and row[n] >= k:
                    e = state[n]
                    axis = e % 3
                    i = e if e < 6 else e - 3
                    total = 0.0
                    for m in range(6):
                        total += K[n, m] * z[m]
                    mu[j, n] = q[j, n] - W[n] * total
                    z[i] += (slope[axis] if e < 6 else -slope[axis]) * mu[j, n]
                    n -= 1
                k -= 1
            if chunk[c, 0] == blocks[run, 1]:
                for m in range(6):
                    z0[j, run, m] = z[m]
