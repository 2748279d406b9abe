"""Measurement updates for a quantised encoder: probabilities of intervals and of edges.

A reading of an encoder with step Δ states that the angle is in one interval. Repeating it adds no
information: treating every sample as white noise of variance Δ²/12, or truncating the distribution
to the interval at every sample, produces false effects. The information is in the edges. So the
filter keeps a Gaussian N(m, S) of the angle *together with* the event "still in this interval", of
probability Z = Φ(β) − Φ(α), α, β = (lower, upper edge − m)/√S:

* The reading steps over the edge e between two samples: the angle was e, up to the distance that
  the rate q̇ covers in one period. The density is the flux N(e; m, S) E[q̇⁺] h, divided by the Z
  assumed so far; both factors update the state. The second factor is required: instants selected by
  the angle itself are not an unbiased sample.
* The reading stays: no update until Z has fallen below exp(`NEWS`) of its value at the last update.
  Then the Gaussian is replaced by one with the mean and variance of its part inside the interval,
  and ln Z minus its old value is added to the likelihood.
* The reading jumps several steps, or nearly one per period: mean and variance of the part inside
  the new interval, and ln Z.

A sample taken ``jitter`` (s, standard deviation) early or late has an angle error of rate times
jitter: S grows by (jitter · q̇)². Logs of hosts without real-time scheduling need it.

Every event acts on one number c of the state (an angle or a rate), with score g = ∂ ln Z/∂c and
information w = −∂² ln Z/∂c²: x ← x + P_c g, P ← P − P_c P_cᵀ w, where P_c is the column of P.
Interval: g = (φ(α) − φ(β))/(Z√S), w = g² − (αφ(α) − βφ(β))/(Z S). Rate, with u = E q̇/σ and
f = φ(u) + uΦ(u): g = Φ(u)/(σ f), w = g² − φ(u)/(σ² f). Angles that are on no grid (Δ = 0): every
sample is an event with g = (y − m)/S, w = 1/S.
"""

from __future__ import annotations

import math

from heli3dof.model.compiled import compiled

SQRT2, SQRT2PI = math.sqrt(2.0), math.sqrt(2.0 * math.pi)
NEWS = math.log(0.7)
"""Log of the ratio of Z below which a constant reading causes an update."""


def _tail(x: float) -> float:
    """exp(x²/2) √(2π) Q(x), Mills' ratio of the normal distribution, x ≥ 0."""
    if x < 5.0:
        return SQRT2PI * 0.5 * math.erfc(x / SQRT2) * math.exp(0.5 * x * x)
    d = x
    for n in range(24, 0, -1):  # Laplace's continued fraction
        d = x + n / d
    return 1.0 / d


tail = compiled(_tail, leaf=True, error_model="numpy")


def _interval(lo: float, hi: float, S: float) -> tuple[float, float, float]:
    """(ln Z, g, w) for a normal variable of mean 0 and variance S that lies in (lo, hi)."""
    sd = math.sqrt(S)
    a, b = lo / sd, hi / sd
    sign = 1.0
    if a + b < 0.0:  # mirror, so that a is the nearer end and b > |a|
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


interval = compiled(_interval, leaf=True, error_model="numpy")


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
    # A rate far below zero: Mills' ratio T(u) = Φ/φ; f = φ (1 + u T).
    T = tail(-u)
    f = 1.0 + u * T
    g = T / (sd * f)
    return math.log(sd * f) - 0.5 * u * u - math.log(SQRT2PI), g, g * g - 1.0 / (var * f)


flux = compiled(_flux, leaf=True, error_model="numpy")


def _learn(x, P, c, scale, g, w, column):  # type: ignore[no-untyped-def]
    """Update x and P by an event on state c, read with ``scale``; ``column``: P's scaled column."""
    for j in range(6):
        column[j] = scale * P[j, c]
    for j in range(6):
        x[j] += column[j] * g
        for n in range(j + 1):
            P[j, n] -= column[j] * column[n] * w
            P[n, j] = P[j, n]


learn = compiled(_learn, leaf=True, error_model="numpy")
