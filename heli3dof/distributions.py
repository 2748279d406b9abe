"""Tail probabilities and quantiles of the normal, Student's t and χ² distributions.

`scipy.stats` has the same functions, but importing it takes half a second: a tenth of a quick
diagnosis. All functions take scalars or arrays.
"""

from __future__ import annotations

from typing import Any

import numpy as np


def normal_cdf(x: Any) -> Any:
    """Return P(X ≤ x) of X ~ N(0, 1)."""
    from scipy.special import ndtr

    return ndtr(x)


def normal_isf(p: Any) -> Any:
    """Return the x that X ~ N(0, 1) exceeds with probability p."""
    from scipy.special import ndtri

    return -ndtri(p)


def t_sf(x: Any, nu: Any) -> Any:
    """Return P(X > x) of Student's t with ν degrees of freedom."""
    from scipy.special import stdtr

    return stdtr(nu, -np.asarray(x))


def t_isf(p: Any, nu: Any) -> Any:
    """Return the x that Student's t with ν degrees of freedom exceeds with probability p."""
    from scipy.special import stdtrit

    return -stdtrit(nu, p)


def t_logpdf(x: Any, nu: float) -> Any:
    """Return the logarithm of the density of Student's t with ν degrees of freedom at x.

    ln Γ((ν + 1)/2) − ln Γ(ν/2) − ½ ln(πν) − ½ (ν + 1) ln(1 + x²/ν)
    """
    from scipy.special import gammaln

    scale = gammaln((nu + 1) / 2) - gammaln(nu / 2) - np.log(np.pi * nu) / 2
    return scale - (nu + 1) / 2 * np.log1p(np.asarray(x) ** 2 / nu)


def chi2_sf(x: Any, nu: Any) -> Any:
    """Return P(X > x) of χ² with ν degrees of freedom."""
    from scipy.special import chdtrc

    return chdtrc(nu, x)


def chi2_logsf(x: Any, nu: Any) -> Any:
    """Return ln P(X > x) of χ² with ν degrees of freedom; −∞ where the probability underflows."""
    with np.errstate(divide="ignore"):
        return np.log(chi2_sf(x, nu))


def chi2_isf(p: Any, nu: Any) -> Any:
    """Return the x that χ² with ν degrees of freedom exceeds with probability p."""
    from scipy.special import chdtri

    return chdtri(nu, p)
