"""Measurement updates for a quantised encoder: probabilities of intervals and of edges.

A reading of an encoder with step Δ states that the angle is in one interval between two edges. An
unchanged reading adds almost no information. Treating every sample as white noise of variance
Δ²/12, or truncating the distribution at every sample, makes a fit find effects that do not exist.
So the filter models the angle as a Gaussian N(m, S), and computes the probability Z that the angle
is in the interval. Z = Φ(β) − Φ(α), α = (lower edge − m)/√S, β = (upper edge − m)/√S. φ is the
normal density and Φ its distribution function. The old Z is Z directly after the angle's last
update. Each reading belongs to the first of these cases that applies:

1. The reading does not change. The filter makes no update until Z has fallen below
   exp(`LOG_UPDATE_RATIO`) times the old Z. Then the Gaussian gets the mean and variance of its part
   inside the interval. ln Z minus the old ln Z is added to the log-likelihood.
2. The reading changes by several steps, or the angle moves by half a step or more per sample
   interval, according to the filter's rate. Then the Gaussian gets the mean and variance of its
   part inside the new interval, and ln Z is added.
3. The reading changes by one step, so the angle has passed the edge e since the last sample. After
   the crossing, it moved by at most q̇ h, with the rate q̇ and the sample interval h. q̇⁺ is the rate
   in the direction of the reading's change; it is 0 if q̇ has the opposite direction. The likelihood
   of the crossing is the flux N(e; m, S) E[q̇⁺] h, divided by the old Z. The filter makes two
   updates: the factor N(e; m, S) updates the angle, and the factor E[q̇⁺] updates the rate. The
   second is needed, because a high rate makes a crossing more probable.

If the sampling instants have the standard deviation ``jitter`` (s), S grows by (jitter · q̇)². Logs
of hosts without real-time scheduling need this.

The filter's state is Gaussian. Its mean x contains the angles and rates, and P is its covariance. m
is an element of x, and S is the diagonal element of P for the same angle. Each update uses one
element of x, number c. L is the likelihood of the measurement as a function of x_c. With the score
g = ∂ ln L/∂x_c and the information w = −∂² ln L/∂x_c², the filter computes

    x ← x + P_c g,      P ← P − P_c P_cᵀ w,      where P_c is column c of P.

g and w depend on the kind of update:

* interval, L = Z: g = (φ(α) − φ(β))/(Z√S), w = g² − (αφ(α) − βφ(β))/(Z S)
* angle at the edge e, L = N(e; m, S): g = (e − m)/S, w = 1/S
* rate with the distribution N(v, σ²), L = E[q̇⁺]: g = Φ(u)/(σ f), w = g² − φ(u)/(σ² f), u = v/σ,
  f = φ(u) + uΦ(u)
* reading y that is not quantised (Δ = 0), L = N(y; m, S): g = (y − m)/S, w = 1/S. Such an encoder
  causes this update at every sample
"""

from __future__ import annotations

import math

from heli3dof.model.compiled import inlined

SQRT2, SQRT2PI = math.sqrt(2.0), math.sqrt(2.0 * math.pi)
LOG_UPDATE_RATIO = math.log(0.7)
"""An unchanged reading causes an update if ln Z minus the old ln Z is below this value."""


@inlined
def tail(x: float) -> float:
    """Return Mills' ratio exp(x²/2) √(2π) Q(x), x ≥ 0; Q is the normal density's upper tail."""
    if x < 5.0:
        return SQRT2PI * 0.5 * math.erfc(x / SQRT2) * math.exp(0.5 * x * x)
    d = x
    for n in range(24, 0, -1):  # Laplace's continued fraction
        d = x + n / d
    return 1.0 / d


@inlined
def interval(lo: float, hi: float, S: float) -> tuple[float, float, float]:
    """Return (ln Z, g, w) for the probability Z that X ~ N(m, S) is between ``lo`` and ``hi``.

    g = ∂ ln Z/∂m is the score, w = −∂² ln Z/∂m² the information. All are evaluated at m = 0.
    """
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


@inlined
def rate_event(v: float, var: float) -> tuple[float, float, float]:
    """Return (ln Z, g, w) for the expectation Z = E[max(q̇, 0)] of a rate q̇ ~ N(v, ``var``).

    g = ∂ ln Z/∂v and w = −∂² ln Z/∂v² are score and information.
    """
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


@inlined
def apply_event(x, P, c, scale, g, w, column):  # type: ignore[no-untyped-def]
    """Update the filter's state x (6,) and covariance P (6, 6) by one measurement, in place.

    y is the predicted encoder reading or rate, with ∂y/∂x[c] = ``scale``. L is the measurement's
    likelihood: g = ∂ ln L/∂y, w = −∂² ln L/∂y². p = ``scale`` · P[:, c] is the covariance between x
    and y before the update; it is written to ``column`` (6,). x ← x + p g, P ← P − p pᵀ w.
    """
    for j in range(6):
        column[j] = scale * P[j, c]
    for j in range(6):
        x[j] += column[j] * g
        for n in range(j + 1):
            P[j, n] -= column[j] * column[n] * w
            P[n, j] = P[j, n]
