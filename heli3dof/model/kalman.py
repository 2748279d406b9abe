"""The extended Kalman filter at the control rate, with encoders read as what they are: intervals.

State x = (r, p, ψ, ṙ, ṗ, ψ̇); the rotors' thrusts are known from the voltages (their equation has
no noise), so they are computed beforehand, exactly. White angular acceleration of intensity a_i²
((rad/s²)²/Hz) drives each axis, so over a step h the covariance P grows by

    P ← Φ P Φᵀ + [ h³/3  h²/2 ; h²/2  h ] ⊗ diag(a²),      Φ from ∂q̈/∂(q, q̇) every 20 ms

An encoder of step Δ says one thing: in which step the angle is. While it rests it says the same
thing again and again, and taking each sample for news (as white noise of variance Δ²/12, or by
cutting the distribution to the step anew five hundred times a second) is what makes false causes.
The news is in its edges. So the belief is a Gaussian N(m, S) for the angle *together with* "it is
still in this step", of probability Z = Φ(β) − Φ(α), α, β = (lower, upper edge − m)/√S, and:

* it steps over the edge e between two samples: the angle was e, to within what the rate q̇ covers in
  one period. The density of that is the flux N(e; m, S) E[q̇⁺] h, divided by the Z that had been
  taken for granted; the state is updated by both factors. The second one cannot be left out:
  instants chosen by the angle itself are not an unbiased sample.
* it rests: nothing, until the belief has spread or drifted so far that Z has fallen below
  `NEWS` of what it was when last looked at. Only then is the Gaussian replaced by the one with the
  mean and variance of its part inside the step, and ln Z less its old value is added.
* it jumps several steps, or nearly one per period: mean and variance of the part inside the new
  step, and ln Z.

A sample taken ``jitter`` (s, standard deviation) early or late reads an angle that is off by the
rate times that: S grows by (jitter · q̇)². A log whose host was not a real-time one needs it.

Every such event acts on one number c of the state (an angle or a rate), with score
g = ∂ ln Z/∂c and information w = −∂² ln Z/∂c²: x ← x + P_c g, P ← P − P_c P_cᵀ w, P_c being P's
column. For the interval g = (φ(α) − φ(β))/(Z√S), w = g² − (αφ(α) − βφ(β))/(Z S); for the rate, with
u = E q̇/σ and f = φ(u) + uΦ(u), g = Φ(u)/(σ f), w = g² − φ(u)/(σ² f). Where angles are not on a
grid (Δ = 0) every sample is an event with g = (y − m)/S, w = 1/S.

Σ ln Z is the likelihood. Along a change of the parameters, with the gains P_c held, the predictor
obeys x ← x + P_c (g − w δc): `follow` runs it for any number of changed parameter sets and so
gives ∂c/∂θ at the events, the only thing that Gauss–Newton needs.
"""

from __future__ import annotations

import math

import numpy as np

from heli3dof.model import rigid_body
from heli3dof.model import slots as _s
from heli3dof.model.compiled import compiled
from heli3dof.model.hooks import caller
from heli3dof.model.rigid_body import accelerations, advance

call = caller()
R, T, F_FRONT, F_BACK, V_FRONT = _s.R, _s.T, _s.F_FRONT, _s.F_BACK, _s.V_FRONT
TAU_M, DELAY, K_F, GAIN_FRONT, GAIN_BACK = _s.TAU_M, _s.DELAY, _s.K_F, _s.GAIN_FRONT, _s.GAIN_BACK
SLEW = _s.SLEW
VOLTAGE, MEASURE = int(_s.Stage.VOLTAGE), int(_s.Stage.MEASURE)
SETUP = int(_s.Stage.SETUP)
RELINEARISE_S = 0.02
NEWS = math.log(0.7)
RATE_0 = 1.0
"""rad/s, how uncertain the rates are where a run starts."""
SQRT2, SQRT2PI = math.sqrt(2.0), math.sqrt(2.0 * math.pi)


def _setup(s, first, address, par, mem):  # type: ignore[no-untyped-def]
    for i in range(first[SETUP], first[SETUP + 1]):
        call(address, i, s, par, mem, s)


setup = compiled(_setup, error_model="numpy")


def _lagged(F: float, target: float, tau: float, slew: float, h: float) -> float:
    """The rotor's F after h s of τ Ḟ = target − F, rising no faster than ``slew`` (0: as it likes).

    Exact: where the limit binds, F rises in a straight line until target − F = slew τ.
    """
    if slew > 0.0 and target - F > slew * tau:
        line = (target - F) / slew - tau
        if h <= line:
            return F + slew * h
        F += slew * line
        h -= line
    if tau <= 0.0:
        return target
    return target + (F - target) * math.exp(-h / tau)


lagged = compiled(_lagged, error_model="numpy")


def _aim(s, V, h, lead, k, first, address, par, mem, out):  # type: ignore[no-untyped-def]
    """The thrusts (2,) N that row k's voltages aim at, rows from ``lead`` on being known."""
    whole, part = 0, 0.0
    if s[DELAY] > 0.0:
        back = s[DELAY] / h[k]
        whole = int(back)
        part = back - whole
    i = max(lead, k - whole)
    j = max(lead, i - 1)
    for m in range(2):
        out[m] = (1.0 - part) * V[i, m] + part * V[j, m]
        s[V_FRONT + m] = out[m]
    for e in range(first[VOLTAGE], first[VOLTAGE + 1]):
        call(address, e, s, par, mem, out)
    out[0] *= s[K_F] * s[GAIN_FRONT]
    out[1] *= s[K_F] * s[GAIN_BACK]


aim = compiled(_aim, error_model="numpy")


def _thrusts(s, V, h, lead, stop, first, address, par, mem, target, F):  # type: ignore[no-untyped-def]
    """Rows lead … stop: what the voltages aim at, and the thrusts at each row's start, (N, 2) N."""
    out = np.empty(2)
    tau = s[TAU_M]
    left, at = 0.0, -1.0
    for k in range(lead, stop):
        aim(s, V, h, lead, k, first, address, par, mem, out)
        for m in range(2):
            target[k, m] = out[m]
            if k == lead:
                F[k, m] = out[m]
            elif s[SLEW] > 0.0:
                slew = s[SLEW] * s[K_F] * s[GAIN_FRONT + m]
                F[k, m] = lagged(F[k - 1, m], target[k - 1, m], tau, slew, h[k - 1])
            else:
                if h[k - 1] != at:
                    at = h[k - 1]
                    left = math.exp(-at / tau) if tau > 0.0 else 0.0
                F[k, m] = target[k - 1, m] + (F[k - 1, m] - target[k - 1, m]) * left


thrusts = compiled(_thrusts, calls=(_lagged, _aim), error_model="numpy")


def _step(s, x, k, t, h, V, target, F, first, address, par, mem, free, w, decay):  # type: ignore[no-untyped-def]
    """x (6,) from row k to the next; ``decay`` (3,) keeps exp(−h/2τ) and exp(−h/τ) for its h."""
    if decay[0] != h[k]:
        decay[0] = h[k]
        tau = s[TAU_M]
        decay[1] = math.exp(-0.5 * h[k] / tau) if tau > 0.0 else 0.0
        decay[2] = decay[1] * decay[1]
    s[T] = t[k]
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


step = compiled(_step, calls=(rigid_body._advance, _lagged), error_model="numpy")


def _glide(s, x, k, t, h, V, target, F, first, address, par, mem, free, w, decay):  # type: ignore[no-untyped-def]
    """As `_step`, by the midpoint rule: a third of the work, for differences of two runs."""
    if decay[0] != h[k]:
        decay[0] = h[k]
        decay[1] = math.exp(-0.5 * h[k] / s[TAU_M]) if s[TAU_M] > 0.0 else 0.0
    s[T] = t[k]
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


glide = compiled(_glide, calls=(rigid_body._accelerations, _lagged), error_model="numpy")


def _readings(s, x, first, address, par, mem, m, slope):  # type: ignore[no-untyped-def]
    """What the encoders should read, (3,) rad into m, and ∂m_i/∂q_i into ``slope``."""
    for i in range(3):
        m[i] = x[i]
        slope[i] = 1.0
    if first[MEASURE + 1] > first[MEASURE]:
        for i in range(3):
            slope[i] = x[i] + 1e-6
            s[R + i], s[R + 3 + i] = x[i], x[3 + i]
        for e in range(first[MEASURE], first[MEASURE + 1]):
            call(address, e, s, par, mem, m)
            call(address, e, s, par, mem, slope)
        for i in range(3):
            slope[i] = (slope[i] - m[i]) / 1e-6


readings = compiled(_readings, error_model="numpy")


def _tail(x: float) -> float:
    """exp(x²/2) √(2π) Q(x), Mills' ratio of the normal distribution, x ≥ 0."""
    if x < 5.0:
        return SQRT2PI * 0.5 * math.erfc(x / SQRT2) * math.exp(0.5 * x * x)
    d = x
    for n in range(24, 0, -1):  # Laplace's continued fraction
        d = x + n / d
    return 1.0 / d


tail = compiled(_tail, error_model="numpy")


def _interval(lo: float, hi: float, S: float) -> tuple[float, float, float]:
    """(ln Z, g, w) for a normal variable of mean 0 and variance S that lies in (lo, hi)."""
    sd = math.sqrt(S)
    a, b = lo / sd, hi / sd
    sign = 1.0
    if a + b < 0.0:  # mirrored, so that a is the nearer end and b > |a|
        a, b = -b, -a
        sign = -1.0
    if a > 3.0:
        # Everything relative to φ(a): Z = φ(a) (tail(a) − e tail(b)), e = φ(b)/φ(a).
        e = math.exp(0.5 * (a * a - b * b))
        z = tail(a) - e * tail(b)
        logZ = -0.5 * a * a - math.log(SQRT2PI) + math.log(z)
        ratio = (1.0 - e) / z
        second = (a - b * e) / z
    else:
        Z = 0.5 * (math.erfc(a / SQRT2) - math.erfc(b / SQRT2))
        fa = math.exp(-0.5 * a * a) / SQRT2PI
        fb = math.exp(-0.5 * b * b) / SQRT2PI
        logZ = math.log(Z)
        ratio = (fa - fb) / Z
        second = (a * fa - b * fb) / Z
    return logZ, sign * ratio / sd, (ratio * ratio - second) / S


interval = compiled(_interval, calls=(_tail,), error_model="numpy")


def _flux(v: float, var: float) -> tuple[float, float, float]:
    """(ln E[v⁺], g, w) of a rate with this mean and variance, v⁺ = max(v, 0)."""
    sd = math.sqrt(var)
    u = v / sd
    phi = math.exp(-0.5 * u * u) / SQRT2PI
    if u > -4.0:
        Phi = 0.5 * math.erfc(-u / SQRT2)
        f = phi + u * Phi
        g = Phi / (sd * f)
        return math.log(sd * f), g, g * g - phi / (var * f)
    # Far on the wrong side: Mills' ratio T(u) = Φ/φ; f = φ (1 + u T).
    T = tail(-u)
    f = 1.0 + u * T
    g = T / (sd * f)
    return math.log(sd * f) - 0.5 * u * u - math.log(SQRT2PI), g, g * g - 1.0 / (var * f)


flux = compiled(_flux, calls=(_tail,), error_model="numpy")


def _learn(x, P, c, scale, g, w, column):  # type: ignore[no-untyped-def]
    """x and P after an event on state c, read with ``scale``; P's scaled column is kept."""
    for j in range(6):
        column[j] = scale * P[j, c]
    for j in range(6):
        x[j] += column[j] * g
        for n in range(j + 1):
            P[j, n] -= column[j] * column[n] * w
            P[n, j] = P[j, n]


learn = compiled(_learn, error_model="numpy")


def _grow(P, A, h, a2, Phi, W):  # type: ignore[no-untyped-def]
    """P (6, 6) one step on; A (3, 6) = ∂q̈/∂(q, q̇); Phi and W (6, 6) are work space."""
    for i in range(3):
        for j in range(6):
            Phi[i, j] = 0.5 * h * h * A[i, j]
            Phi[3 + i, j] = h * A[i, j]
        Phi[i, i] += 1.0
        Phi[i, 3 + i] += h
        Phi[3 + i, 3 + i] += 1.0
    for i in range(6):
        for j in range(6):
            acc = 0.0
            for n in range(6):
                acc += Phi[i, n] * P[n, j]
            W[i, j] = acc
    for i in range(6):
        for j in range(i + 1):
            acc = 0.0
            for n in range(6):
                acc += W[i, n] * Phi[j, n]
            P[i, j] = acc
            P[j, i] = acc
    for i in range(3):
        P[i, i] += a2[i] * h * h * h / 3.0
        P[i, 3 + i] += a2[i] * h * h / 2.0
        P[3 + i, i] = P[i, 3 + i]
        P[3 + i, 3 + i] += a2[i] * h


grow = compiled(_grow, error_model="numpy")


def _linearise(s, x, F, first, address, par, mem, free, w, A):  # type: ignore[no-untyped-def]
    """∂q̈/∂(q, q̇) (3, 6) into A, by differences."""
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


linearise = compiled(_linearise, calls=(rigid_body._accelerations,), error_model="numpy")


def _filter(  # type: ignore[no-untyped-def]
    s0, first, address, par, mem0, blocks, free, grid, t, h, V, y, a2, jitter, R2, keep,
    loglik, row, state, C, G, W, K, X,
):  # fmt: skip
    """All blocks through the filter; see the module. Returns the number of events E.

    ``loglik`` (3,) sums ln Z by axis. With keep ≥ 1, for each event: its ``row``, its ``state``
    (0–2 an angle's reading, 3–5 a rate's, 6–8 a rate's the other way), its prediction C, score G,
    information W and gain K (6,); with keep ≥ 2: X (N, 6) states after the updates of a row.
    """
    N = V.shape[0]
    target, F = np.empty((N, 2)), np.empty((N, 2))
    x, P, A = np.empty(6), np.empty((6, 6)), np.empty((3, 6))
    Phi, work = np.zeros((6, 6)), np.empty((6, 6))
    m, slope, w = np.empty(3), np.empty(3), np.zeros((8, 3))
    column, decay = np.empty(6), np.full(3, -1.0)
    last, logZ0 = np.empty(3), np.zeros(3)
    seen = first[MEASURE + 1] > first[MEASURE]
    E = 0
    for b in range(blocks.shape[0]):
        s = s0.copy()
        mem = mem0.copy()
        axes = free[b]
        setup(s, first, address, par, mem)
        lead, start, stop = blocks[b, 0], blocks[b, 1], blocks[b, 2]
        thrusts(s, V, h, lead, stop, first, address, par, mem, target, F)
        decay[0] = -1.0
        P[:, :] = 0.0
        for i in range(3):
            x[i] = y[start, i] if y[start, i] == y[start, i] else 0.0
            x[3 + i] = 0.0
            last[i] = y[start, i]
            logZ0[i] = 0.0
            if axes[i]:
                P[i, i] = grid[b, i] ** 2 / 12.0 if grid[b, i] > 0.0 else R2[i]
                P[3 + i, 3 + i] = RATE_0**2
        readings(s, x, first, address, par, mem, m, slope)
        for i in range(3):
            x[i] -= (m[i] - x[i]) / slope[i]
        since = 1e9
        for k in range(start, stop):
            for i in range(3):
                if y[k, i] != y[k, i] or not axes[i]:
                    continue
                if seen:
                    readings(s, x, first, address, par, mem, m, slope)
                    at, scale = m[i], slope[i]
                else:
                    at, scale = x[i], 1.0
                v = scale * x[3 + i]
                S = scale * scale * P[i, i] + jitter * jitter * v * v
                e = y[k, i] - at
                D = grid[b, i]
                over = y[k, i] - last[i]
                last[i] = y[k, i]
                rate = 0.0
                if D == 0.0:
                    S += R2[i]
                    logZ = -0.5 * (e * e / S + math.log(2.0 * math.pi * S))
                    g, info = e / S, 1.0 / S
                elif abs(over) < 0.5 * D:
                    room = 0.5 * D - abs(e)
                    if room > 0.0 and room * room > 1.5 * S:
                        continue
                    S += R2[i]
                    logZ, g, info = interval(e - 0.5 * D, e + 0.5 * D, S)
                    if logZ - logZ0[i] > NEWS:
                        continue
                    logZ -= logZ0[i]
                    left = max(S * (1.0 - S * info), 1e-6 * S)
                    logZ0[i] = interval(e - S * g - 0.5 * D, e - S * g + 0.5 * D, left)[0]
                else:
                    rate = 1.0 if over > 0.0 else -1.0
                    speed = abs(scale * x[3 + i]) * h[k]
                    if abs(over) < 1.5 * D and speed < 0.5 * D:
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
                learn(x, P, i, scale, g, info, column)
                if keep >= 1:
                    row[E], state[E], C[E], G[E], W[E] = k, i, at, g, info
                    for j in range(6):
                        K[E, j] = column[j]
                E += 1
                if rate != 0.0:
                    scale *= rate
                    at = scale * x[3 + i]
                    logZ, g, info = flux(at, scale * scale * P[3 + i, 3 + i])
                    loglik[i] += logZ + math.log(h[k])
                    learn(x, P, 3 + i, scale, g, info, column)
                    if keep >= 1:
                        up = 3 + i if rate > 0.0 else 6 + i
                        row[E], state[E], C[E], G[E], W[E] = k, up, at, g, info
                        for j in range(6):
                            K[E, j] = column[j]
                    E += 1
            if keep >= 2:
                for j in range(6):
                    X[k, j] = x[j]
            if k + 1 < stop:
                if since >= RELINEARISE_S:
                    since = 0.0
                    s[T] = t[k]
                    linearise(s, x, F[k], first, address, par, mem, axes, w, A)
                since += h[k]
                step(s, x, k, t, h, V, target, F, first, address, par, mem, axes, w, decay)
                grow(P, A, h[k], a2, Phi, work)
    return E


_CALLS = (
    rigid_body._advance, _lagged, _aim, _thrusts, _step, _readings, _interval, _tail, _flux, _learn,
    _grow, _linearise, _glide, rigid_body._accelerations,
)  # fmt: skip
filter_blocks = compiled(_filter, calls=_CALLS, error_model="numpy", nogil=True)


def _follow(  # type: ignore[no-untyped-def]
    s0, first, address, pars, mem0, blocks, free, t, h, V, y, row, state, C, G, W, K, D
):  # fmt: skip
    """Other parameter sets under the filter's gains: D (J, E) becomes c_j − c at each event.

    Integrated more coarsely than the filter does: take the difference from a set that is the
    filter's own, followed likewise.

    s0 (J, SIZE) and pars (J, hooks, PARAMETERS) hold the sets.
    """
    N, E = V.shape[0], row.shape[0]
    seen = first[MEASURE + 1] > first[MEASURE]
    target, F = np.empty((N, 2)), np.empty((N, 2))
    x = np.empty(6)
    m, slope, w = np.empty(3), np.ones(3), np.zeros((8, 3))
    decay = np.full(3, -1.0)
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
            decay[0] = -1.0
            for i in range(3):
                x[i] = y[start, i] if y[start, i] == y[start, i] else 0.0
                x[3 + i] = 0.0
            readings(s, x, first, address, par, mem, m, slope)
            for i in range(3):
                x[i] -= (m[i] - x[i]) / slope[i]
            for k in range(start, stop):
                while n < E and row[n] == k:
                    c = state[n]
                    if c < 3:
                        if seen:
                            readings(s, x, first, address, par, mem, m, slope)
                            d = m[c] - C[n]
                        else:
                            d = x[c] - C[n]
                    elif c < 6:
                        d = slope[c - 3] * x[c] - C[n]
                    else:
                        d = -slope[c - 6] * x[c - 3] - C[n]
                    D[v, n] = d
                    g = G[n] - W[n] * d
                    for j in range(6):
                        x[j] += K[n, j] * g
                    n += 1
                if k + 1 < stop:
                    glide(s, x, k, t, h, V, target, F, first, address, par, mem, axes, w, decay)


follow = compiled(_follow, calls=_CALLS, error_model="numpy", nogil=True)
