"""Test innovations on held-out data: whiteness, and independence of past voltages.

Innovations e are one-step prediction errors. For a correct model they are white and independent of
past inputs. tr is the trace, ~ means "follows the distribution". Whiteness (Hosking 1980, the
multivariate portmanteau test) of N innovations e with l outputs, over h lags:

    Q = N² Σ_{j=1}^{h} tr(R_jᵀ R_0⁻¹ R_j R_0⁻¹)/(N − j)  ~  χ²(l² h),     R_j = (1/N) Σ e[k] e[k−j]ᵀ

Past inputs (score test): e[k] is regressed on the h vectors u[k−1], …, u[k−h] of m voltages. S_e is
the covariance of e, S_p that of the regression's prediction:

    LM = N tr(S_e⁻¹ S_p)  ~  χ²(l m h)

The χ² distribution of LM holds for coloured u, as long as e is white. Under feedback only *past*
inputs can be tested, because present and future ones respond to e. No parameter was fitted to
held-out data, so no degrees of freedom are subtracted.

Both statistics grow with the length of the recording, so that in minutes of flight they detect even
harmless nonlinearity. So each test also gives the share of the innovations' variance that the past
explains.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from heli3dof.distributions import chi2_isf, chi2_sf

LEVEL = 0.01
"""Significance level of both tests"""


@dataclass(frozen=True)
class ResidualTest:
    """The result of a residual test: passed if ``statistic`` ≤ ``bound`` (99 % quantile of χ²)."""

    name: str
    statistic: float
    degrees_of_freedom: int
    p_value: float
    bound: float
    share: float
    """Share of the innovations' variance that past innovations or voltages explain (mean over
    outputs). It is adjusted for the number of regressors, like the adjusted R²."""
    samples: int

    @property
    def passed(self) -> bool:
        return self.statistic <= self.bound

    def to_json(self) -> dict[str, Any]:
        return {
            "statistic": self.statistic,
            "degrees_of_freedom": self.degrees_of_freedom,
            "p_value": self.p_value,
            "bound_99_percent": self.bound,
            "explained_share": self.share,
            "samples": self.samples,
            "passed": self.passed,
        }

    def sentence(self) -> str:
        """Return the result as a line of text."""
        verdict = "passed" if self.passed else "not passed"
        return (
            f"{self.name}: {verdict} (χ²({self.degrees_of_freedom}) = {self.statistic:.4g}, "
            f"99 % bound {self.bound:.4g}, p {self.p_value:.2g}; the past explains "
            f"{100 * self.share:.1f} % of the innovations)"
        )


def whiteness(innovations: Sequence[np.ndarray], h: int = 20) -> ResidualTest:
    """Return the result of the whiteness test over ``h`` lags.

    ``innovations`` has an array (N_i, l) per segment; segments of at most 2h rows are skipped.
    """
    es = [e - np.vstack(list(innovations)).mean(axis=0) for e in innovations if len(e) > 2 * h]
    N = sum(len(e) for e in es)
    l = es[0].shape[1]
    R0 = sum(e.T @ e for e in es) / N
    Ri = np.linalg.inv(R0)
    Q = 0.0
    for j in range(1, h + 1):
        R = sum(e[j:].T @ e[:-j] for e in es) / N
        Q += N**2 * float(np.trace(R.T @ Ri @ R @ Ri)) / (N - j)
    # The share is computed by a regression; it differs from Q/N if the lags are correlated.
    past = np.vstack([np.hstack([e[h - j : len(e) - j] for j in range(1, h + 1)]) for e in es])
    return _result("whiteness", Q, l * l * h, N, np.vstack([e[h:] for e in es]), past)


def past_inputs(
    innovations: Sequence[np.ndarray], inputs: Sequence[np.ndarray], h: int = 20
) -> ResidualTest:
    """Return the result of the test whether innovations are independent of ``h`` past voltages.

    ``innovations`` has an array (N_i, l) per segment, ``inputs`` an array of voltages (N_i, m);
    segments of at most 2h rows are skipped.
    """
    E, Z = [], []
    for e, u in zip(innovations, inputs, strict=True):
        if len(e) > 2 * h:
            E.append(e[h:])
            Z.append(np.hstack([u[h - j : len(u) - j] for j in range(1, h + 1)]))
    e, z = np.vstack(E), np.vstack(Z)
    e, z = e - e.mean(axis=0), z - z.mean(axis=0)
    LM = len(e) * _explained(e, z)
    return _result("past inputs", LM, e.shape[1] * z.shape[1], len(e), e, z)


def _explained(e: np.ndarray, z: np.ndarray) -> float:
    """Return tr(S_e⁻¹ S_p) of a regression of e (N, l) on z (N, q).

    S_e is the covariance of e, S_p that of the regression's prediction of e. The value is 0 if
    the regression explains nothing of e, and l if it explains all.
    """
    q, _ = np.linalg.qr(z / (z.std(axis=0) + 1e-12))
    p = q.T @ e
    return float(np.trace(np.linalg.solve(e.T @ e, p.T @ p)))


def _result(
    name: str, statistic: float, dof: int, N: int, e: np.ndarray, z: np.ndarray
) -> ResidualTest:
    # q regressors explain a share q/N of white noise: subtract it.
    l, q = e.shape[1], z.shape[1]
    raw = _explained(e, z) / l
    share = max(0.0, (raw - q / len(e)) / max(1 - q / len(e), 1e-9))

    return ResidualTest(
        name,
        statistic,
        dof,
        float(chi2_sf(statistic, dof)),
        float(chi2_isf(LEVEL, dof)),
        share,
        N,
    )
