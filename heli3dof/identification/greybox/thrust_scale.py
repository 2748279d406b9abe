"""Estimate the thrust gain K_f from four fitted parameters and the profile's tolerance.

Flights do not identify K_f: if all torques and inertias are multiplied by the same factor, the
motion is the same (`heli3dof.model.physics.rigid_body`). Let X be the gravity torque and the
inertias (T_g, J_roll, J_pitch, J_yaw), and k = K_f/K_f,nominal. A fit with K_f at its nominal value
gives only x_i = X_i/k. The profile's values of K_f and of the four parameters have the relative
standard error s, half the profile's ``tolerance``. To allow for outliers, the posterior density of
ln k uses Student's t density t_ν with ν = `DEGREES_OF_FREEDOM`:

    p(ln k) ∝ t_ν(ln k/s) Π_i t_ν(ln(x_i k/X_i,nominal)/√(s² + σ_i²)),    σ_i: relative std of x_i

If all four ratios x_i/X_i,nominal have the same value, the estimate of k is near its inverse. If
only one ratio deviates from 1, k stays near 1. k, estimated by exp(mean of ln k), converts torques
and inertias to SI.

Let ε be the profile's ``tolerance``, and e = ln(1 + ε) for ln k > 0, else ln(1 − ε). A warning
reports a deviation of K_f if k is outside the tolerance, and ln k differs significantly from zero:

    |ln k| > |e|,    |ln k| > `SCALE_QUANTILE` σ_k        σ_k: standard deviation of ln k

The estimate is cautious: if all x_i deviate by one factor, |ln k| is smaller than ln of this
factor. So parameters that are each within the tolerance cause no warning.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from heli3dof.identification.greybox.physical_fit import PhysicalFit

if TYPE_CHECKING:
    from heli3dof.model.greybox.model import GreyBoxModel

DEGREES_OF_FREEDOM = 3.0  # ν, chosen
LOG_K_MAX = 1.5  # largest |ln k| of the grid on which p is evaluated: k to 4.5, chosen
TORQUE_UNITS = ("N·m", "kg")
"""A parameter scales with K_f if its unit contains one of these."""
BASE = ("K_f", "T_g", "J_roll", "J_pitch", "J_yaw")
"""Basic parameters of a rig: thrust gain, gravity torque of the level arm, three inertias"""
SCALE_QUANTILE = 2.0  # standard deviations, chosen


@dataclass(frozen=True)
class Measured:
    """The estimate of a rig parameter in SI units, with nominal value and standard deviation."""

    nominal: float
    value: float
    std: float


@dataclass(frozen=True)
class ThrustScale:
    """The ratio k of the rig's thrust gain to that in the profile, and the std of ln k."""

    k: float
    std: float

    def to_si(self, value: float, std: float, unit: str) -> tuple[float, float]:
        """Return an estimate in SI and its standard deviation, corrected by the factor k.

        A fit assumes the thrust gain in the profile. The rig's gain is k times this gain, so its
        true torques, masses and inertias are k times their estimates. The returned standard
        deviation includes the uncertainty of k. If the ``unit`` contains neither N·m nor kg, the
        estimate does not depend on the thrust gain. Then ``value`` and ``std`` are returned
        unchanged.
        """
        if not any(u in unit for u in TORQUE_UNITS):
            return value, std
        return value * self.k, self.k * float(np.hypot(std, value * self.std))

    def is_off(self, tolerance: float) -> bool:
        """Return True if the thrust gain deviates significantly by more than ``tolerance``."""
        ln_k = float(np.log(self.k))
        return abs(ln_k) > max(abs(edge(ln_k, tolerance)), SCALE_QUANTILE * self.std)


def edge(x: float, tolerance: float) -> float:
    """Return the limit of x = ln(value/nominal) for a relative ``tolerance``, on the side of x.

    The limit is ln(1 + tolerance) for x > 0, else ln(1 − tolerance).

    >>> round(edge(0.3, 0.15), 4), round(edge(-0.3, 0.15), 4)
    (0.1398, -0.1625)
    """
    return float(np.log1p(tolerance) if x > 0 else np.log1p(-tolerance))


def thrust_scale(fit: PhysicalFit | GreyBoxModel) -> ThrustScale:
    """Estimate the ratio k of the rig's thrust gain to the thrust gain in the profile.

    A fit assumes the profile's thrust gain. It then estimates 1/k times the true gravity torque and
    1/k times the true inertias. So if these four parameters of ``fit`` deviate from nominal by
    one factor, the thrust gain is probably wrong (`of_ratios`).

    Some models do not contain standard deviations of these parameters. They are then set to 0: only
    the uncertainty of the nominal values, half the profile's tolerance, is taken into account.
    """
    nominal = np.array([f.start for f in fit.structure.free[:4]])
    x = fit.values[:4] / nominal
    std = np.where(np.isfinite(fit.std[:4]), fit.std[:4], 0.0) / np.abs(nominal)
    return of_ratios(x, std, 0.5 * fit.structure.profile.tolerance)


def of_ratios(ratios: np.ndarray, std: np.ndarray, s: float) -> ThrustScale:
    """Return the ratio k of the thrust gain to its nominal value, from four other ``ratios`` (4,).

    These are the ratios of the fitted gravity torque and three inertias to their nominal values.
    They are estimates of 1/k. ``std`` (4,) are their standard deviations. ``s`` is the relative
    standard error of all nominal values. Ratios that are not positive are ignored.

    >>> scale = of_ratios(np.full(4, 1 / 1.4), np.zeros(4), 0.075)
    >>> round(scale.k, 1)
    1.4
    """
    u = np.linspace(-LOG_K_MAX, LOG_K_MAX, 3001)
    log_p = _log_t(u / s)
    for value, error in zip(ratios, std, strict=True):
        if value > 0:
            width = np.hypot(s, error / value)
            log_p = log_p + _log_t((np.log(value) + u) / width)
    p = np.exp(log_p - log_p.max())
    p /= p.sum()
    mean = float(p @ u)
    return ThrustScale(float(np.exp(mean)), float(np.sqrt(p @ (u - mean) ** 2)))


def thrust_gain_warning(fit: PhysicalFit) -> tuple[str, ...]:
    """Return a warning if the thrust gain is outside the profile's tolerance, else ()."""
    profile, scale = fit.structure.profile, thrust_scale(fit)
    if not scale.is_off(profile.tolerance):
        return ()
    K_f = profile.motor.K_f
    alike = ", ".join(
        f.name
        for f, x in zip(fit.free[:4], fit.values, strict=False)
        if abs(x * scale.k / f.start - 1) <= profile.tolerance
    )
    return (
        f"Deviating from the profile by about one factor, {1 / scale.k:.2f}: {alike}. Likely "
        f"cause: the thrust gain motor.K_f is {K_f * scale.k:.3g} ± "
        f"{K_f * scale.k * scale.std:.1g} N/V, not {K_f:.3g}, because a flight determines only "
        "ratios to K_f. Measure the thrust with a scale, or correct the profile: heli3dof profile "
        "update --from MODEL.json --profile RIG.toml -o RIG2.toml",
    )


def _log_t(z: np.ndarray) -> np.ndarray:
    return np.asarray(-0.5 * (DEGREES_OF_FREEDOM + 1) * np.log1p(z**2 / DEGREES_OF_FREEDOM))
