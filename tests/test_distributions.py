"""The tail probabilities equal those of scipy.stats, which is slower to import."""

import numpy as np
import pytest
from scipy import stats

from heli3dof import distributions as d

X = np.array([-3.0, -0.2, 0.0, 1.0, 4.5, 30.0])
P = np.array([1e-12, 1e-4, 0.05, 0.5, 0.99])
NU = 3.7


@pytest.mark.parametrize(
    ("ours", "reference"),
    [
        (d.normal_cdf(X), stats.norm.cdf(X)),
        (d.normal_isf(P), stats.norm.isf(P)),
        (d.t_sf(X, NU), stats.t.sf(X, NU)),
        (d.t_isf(P, NU), stats.t.isf(P, NU)),
        (d.t_logpdf(X, NU), stats.t.logpdf(X, NU)),
        (d.chi2_sf(abs(X), NU), stats.chi2.sf(abs(X), NU)),
        (d.chi2_logsf(abs(X), NU), stats.chi2.logsf(abs(X), NU)),
        (d.chi2_isf(P, NU), stats.chi2.isf(P, NU)),
    ],
)
def test_a_function_equals_that_of_scipy_stats(ours, reference):
    assert ours == pytest.approx(reference, rel=1e-10, abs=1e-300)


def test_a_probability_that_underflows_has_the_logarithm_minus_infinity():
    assert d.chi2_logsf(1e5, 2) == -np.inf
