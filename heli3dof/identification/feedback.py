"""Test for feedback: are the voltages correlated with past innovations of the angles?

Autoregressions of order p whiten both signals. e is the innovation of a regression of the 3 angles
on past angles and voltages; w is the innovation of a regression of the 2 voltages on their
own past. Without feedback, w[k] is independent of e[k], e[k−1], …. Then over h lags and N samples,
with tr the trace and ~ for "follows the distribution",

    Q = N Σ_{j=0}^{h−1} tr(R_jᵀ R_j)  ~  χ²(2·3·h),      R_j = corr(w[k], e[k−j])

with w and e scaled to unit covariance (Haugh 1976; Söderström & Stoica 1989, section 12.10).
The sum includes j = 0, because a controller computes the voltages of sample k from its angles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from heli3dof.distributions import chi2_sf
from heli3dof.identification.black_box.pbsid import Pair, varx

LEVEL = 1e-3
"""Significance level of the feedback test"""
ORDER, LAGS = 10, 5
"""Order of the autoregressions that whiten both signals, and number of lags h in the test"""
SHARE_MIN = 0.005
"""Smallest `Feedback.share` that counts as feedback; a smaller one hardly biases a fit."""


@dataclass(frozen=True)
class Feedback:
    """The result of a feedback test: χ² statistic, p-value, and whether feedback is ``present``.

    Feedback means that the voltages respond to the angles. Let e be the errors of one-step
    predictions of the angles from earlier angles and voltages. Let w be the errors of one-step
    predictions of the voltages from earlier voltages. ``share`` (0 to 1) is the part of the
    variance of w that e explains. ``sentence`` states the result for the report.
    """

    statistic: float
    degrees_of_freedom: int
    p_value: float
    share: float
    present: bool
    sentence: str


def feedback_test(data: Sequence[Pair]) -> Feedback:
    """Return the result of the feedback test: do the voltages respond to the angles?

    ``data`` has a pair per segment without gaps: voltages (N, 2) V, angles (N, 3) rad.
    """
    p, h = ORDER, LAGS
    long = [(u, y) for u, y in data if len(u) > 3 * p]
    fit = varx(long, p)
    w = varx([(u[:, :0], u) for u, _ in long], p).innovations
    e = fit.innovations
    cov_w = np.mean(np.vstack([a.T @ a / len(a) for a in w]).reshape(-1, 2, 2), axis=0)
    size = float(np.mean([np.var(u) for u, _ in long]))
    dof = 2 * 3 * h
    if np.trace(cov_w) < 1e-9 * size:
        sentence = (
            "No feedback: the voltages follow exactly from their own past (a constant, a ramp, a "
            "periodic signal), so they do not respond to the angles."
        )
        return Feedback(0.0, dof, 1.0, 0.0, False, sentence)
    Lw = _whitener(cov_w)
    Le = _whitener(fit.S)
    N = sum(len(a) - h for a in w)
    q, share = 0.0, 0.0
    for j in range(h):
        R = (
            sum(
                (a[h:] @ Lw.T).T @ (b[h - j : len(b) - j] @ Le.T) for a, b in zip(w, e, strict=True)
            )
            / N
        )
        q += N * float(np.sum(R**2))
        share += float(np.sum(R**2)) / 2
    p_value = float(chi2_sf(q, dof))
    present = p_value < LEVEL and share > SHARE_MIN
    return Feedback(q, dof, p_value, share, present, _sentence(q, dof, p_value, share, present))


def _whitener(cov: np.ndarray) -> np.ndarray:
    """Return a matrix L with L cov Lᵀ = I; it omits directions in which ``cov`` is zero."""
    lam, V = np.linalg.eigh(cov)
    keep = lam > 1e-12 * lam.max()
    return np.asarray((V[:, keep] / np.sqrt(lam[keep])).T)


def _sentence(q: float, dof: int, p_value: float, share: float, present: bool) -> str:
    shown = "below 1e-12" if p_value < 1e-12 else f"{p_value:.2g}"
    numbers = f"χ²({dof}) = {q:.4g}, p {shown}, {100 * share:.1f} % of the voltages' innovation"
    if present:
        return (
            f"Feedback: the voltages respond to past output noise ({numbers}). Output error "
            "assumes an input independent of the noise, so it is biased here; prediction error on "
            "innovations is not."
        )
    return (
        f"No feedback detected ({numbers}). Prediction error and output error are both consistent."
    )
