"""Test whether one factor explains all three inertias, as a wrong thrust gain K_f does.

A flight determines K_f/J only (`heli3dof.model.physics.rigid_body`). A fit keeps the profile's K_f,
so a rig whose thrust gain is K_f/c shows all inertias c times too large. With the log-ratios
x_i = ln(J_i/J_i,nominal), their covariance C, the relative error s of the nominal inertias (half
the profile's ``tolerance``) and Σ = C + s² I:

    ln c = (1ᵀ Σ⁻¹ x)/(1ᵀ Σ⁻¹ 1),    σ² = 1/(1ᵀ Σ⁻¹ 1)
    Q = (x − 1 ln c)ᵀ Σ⁻¹ (x − 1 ln c)     χ² with 2 degrees of freedom if one factor explains x

The factor is reported if one factor explains the inertias (Q below the 95 % quantile), the 95 %
interval of c excludes 1, and c is beyond the tolerance. T_g is not tested, because its nominal
value 2 L_a K_f V_o depends on K_f itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, log1p, nan

import numpy as np

from heli3dof.axes import AXES
from heli3dof.identification.greybox.physical_fit import PhysicalFit

INERTIAS = tuple(f"J_{axis}" for axis in AXES)
Z95 = 1.96
"""Two-sided 95 % quantile of the normal distribution"""
CHI2_95 = 5.991
"""95 % quantile of χ² with 2 degrees of freedom"""


@dataclass(frozen=True)
class CommonFactor:
    """The factor c of all inertias, with its 95 % interval."""

    factor: float
    low: float
    high: float

    def sentence(self, K_f: float) -> str:
        """Return the finding in words; ``K_f``: the profile's, N/V."""
        return (
            f"All three inertias are {self.factor:.2f} times the profile's (95 % interval "
            f"{self.low:.2f} to {self.high:.2f}), one common factor. Likely cause: the thrust gain "
            f"motor.K_f is {K_f / self.factor:.3g} N/V ({K_f / self.high:.3g} to "
            f"{K_f / self.low:.3g}), not {K_f:.3g}, because a flight determines K_f/J only. "
            "Measure the thrust with a scale, or correct the profile: heli3dof profile update "
            "--from MODEL.json --profile RIG.toml -o RIG2.toml"
        )


def common_factor(x: np.ndarray, covariance: np.ndarray, tolerance: float) -> CommonFactor | None:
    """Return the common factor of the inertias; None if the tests of the module do not show one.

    x (3,): logarithms of the ratios to nominal; ``covariance`` (3, 3): theirs.
    """
    total = covariance + (tolerance / 2) ** 2 * np.eye(len(x))
    ln_c, std = generalised_mean(x, total)
    if not np.isfinite(std):
        return None
    rest = x - ln_c
    limit = log1p(tolerance) if ln_c > 0 else -log1p(-tolerance)
    one_factor = float(rest @ np.linalg.solve(total, rest)) <= CHI2_95
    if not one_factor or abs(ln_c) <= max(limit, Z95 * std):
        return None
    return CommonFactor(exp(ln_c), exp(ln_c - Z95 * std), exp(ln_c + Z95 * std))


def thrust_gain_warnings(found: PhysicalFit) -> tuple[str, ...]:
    """Return a sentence if a wrong thrust gain explains the fitted inertias, otherwise none."""
    names = found.structure.names
    at = [names.index(n) for n in INERTIAS]
    J = found.values[at]
    nominal = np.array([found.structure.free[i].start for i in at])
    profile = found.structure.profile
    covariance = found.covariance[np.ix_(at, at)] / np.outer(J, J)
    c = common_factor(np.log(J / nominal), covariance, profile.tolerance)
    return () if c is None else (c.sentence(profile.motor.K_f),)


def generalised_mean(x: np.ndarray, covariance: np.ndarray) -> tuple[float, float]:
    """Return the generalised least-squares mean (1ᵀΣ⁻¹x)/(1ᵀΣ⁻¹1) and its standard deviation.

    ``x``: (n,); ``covariance``: Σ (n, n). NaN if Σ is not positive definite.
    """
    try:
        weight = np.linalg.solve(covariance, np.ones(len(x)))
    except np.linalg.LinAlgError:
        return nan, nan
    total = float(weight.sum())
    if not total > 0:
        return nan, nan
    return float(weight @ x) / total, total**-0.5
