"""Convert the base parameters to SI, and test which are off nominal by more than the tolerance.

The base parameters X are the thrust gain K_f, the trim torque T_g and three inertias J. A fit gives
T_g and J in units of K_f, which `greybox.thrust_scale` estimates.

    parameter X     name of the finding     value of the finding
    K_f             motor.thrust_gain       gain = K_f/K_f,nominal
    T_g             mass.imbalance          torque_Nm = T_g − T_g,nominal
    an inertia J    inertia                 ratio = J/J,nominal

Let x = ln X/X_nominal, ε the profile's ``tolerance``, and e = ln(1 + ε) for x > 0, else ln(1 − ε).
X is a finding if |x| significantly exceeds |e|:

    |x| − |e| > √((`SCALE_QUANTILE` σ_k)² + (q f σ)²)

- σ_k: standard deviation of ln K_f (`greybox.thrust_scale`), which further flights hardly reduce
- σ: standard deviation of x caused by noise in the flights
- q: one-sided normal quantile for the false-alarm probability `FALSE_ALARMS`, Bonferroni-corrected
- f: 1 for a fit to free-run predictions, or to edge rates (how often encoder counts change,
  `closed_loop_fit.edge_rates`); else `STD_INFLATION`, because on a limit cycle or with an
  unmodelled torque the error of x may reach f σ

σ_k is large, but it does not affect the ratio of two parameters X_i and X_j. If this ratio differs
from nominal by more than two parameters within the tolerance can explain, one of them is off
nominal, whatever K_f is. So those of the two with |x| > |e| are findings too, if

    x_i − x_j > ln((1 + ε)/(1 − ε)) + q f √(σ_i² + σ_j²)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from heli3dof.diagnosis.constants import FALSE_ALARMS
from heli3dof.distributions import normal_cdf, normal_isf
from heli3dof.identification.bias_correction.correction import CorrectedFit
from heli3dof.identification.greybox.physical_fit import PhysicalFit
from heli3dof.identification.greybox.thrust_scale import (
    SCALE_QUANTILE,
    Measured,
    ThrustScale,
    edge,
    thrust_scale,
)
from heli3dof.model.effects import Term, term
from heli3dof.model.physics.parametrisation import first_parameters

FINDINGS = {
    "K_f": "motor.thrust_gain", "T_g": "mass.imbalance",
    "J_roll": "inertia.roll", "J_pitch": "inertia.pitch", "J_yaw": "inertia.yaw",
}  # fmt: skip
"""Base parameter → name of the finding that it differs from nominal"""
THRUST_GAIN, *PARAMETERS = FINDINGS.values()
"""Names of the findings: THRUST_GAIN belongs to K_f. PARAMETERS belong to T_g and the inertias, in
the order of a fit's parameters."""
STD_INFLATION = 3.0  # f of fits that only maximise the likelihood, chosen


@dataclass(frozen=True)
class BaseParameter(Measured):
    """The estimate of a base parameter (K_f, T_g or an inertia), in SI."""

    name: str
    unit: str
    noise_std: float = 0.0
    """σ, the relative standard deviation caused by noise in the flights"""
    scale: float = 0.0
    """σ_k, the standard deviation of ln K_f"""

    @property
    def x(self) -> float:
        """Return ln(X/X_nominal) of the estimated parameter X; −∞ if X has the wrong sign."""
        ratio = self.value / self.nominal
        return float(np.log(ratio)) if ratio > 0 else -np.inf

    def excess(self, tolerance: float) -> float:
        """Return |x| − |e|: positive if the estimate X deviates by more than the tolerance ε.

        x = ln(X/X_nominal) is the deviation from nominal, and e is its limit: ln(1 + ε) for x > 0,
        else ln(1 − ε). ``tolerance``: ε, the profile's relative tolerance.
        """
        return abs(self.x) - abs(edge(self.x, tolerance))


def quantile() -> float:
    """Return q, the one-sided normal quantile for `FALSE_ALARMS` / number of base parameters.

    >>> round(quantile(), 2)
    3.24
    """
    return float(normal_isf(FALSE_ALARMS / len(FINDINGS)))


def base_parameters(fit: PhysicalFit) -> tuple[BaseParameter, ...]:
    """Return thrust gain K_f, trim torque T_g and three inertias, in SI and in this order."""
    scale = thrust_scale(fit)
    K_f = fit.structure.profile.motor.K_f
    k = K_f * scale.k
    out = [BaseParameter(K_f, k, k * scale.std, "K_f", "N/V", 0.0, scale.std)]
    for f, v, s in zip(fit.free[:4], fit.values[:4], fit.std[:4], strict=True):
        value, std = scale.to_si(float(v), float(s), f.unit)
        out.append(BaseParameter(f.start, value, std, f.name, f.unit, float(s / abs(v)), scale.std))
    return tuple(out)


@dataclass(frozen=True)
class OffNominal:
    """The finding that one base parameter deviates from the profile."""

    term: Term
    value: float
    std: float
    """Estimate of the term's first parameter, in its unit, and its standard deviation"""
    score: float
    """((X − X_nominal)/σ_X)² with the standard deviation σ_X of X"""
    confidence: float
    """Probability that X is beyond the tolerance: Φ((|x| − |e|)/√(σ_k² + (f σ)²))"""
    flight_score: float = 0.0
    """(x/σ)²: the score if K_f were known; 0 for K_f"""
    tied_with: tuple[str, ...] = ()
    """Causes confounded with it (`conclusion.confounded_parameters` and
    `conclusion.confounded_encoder_scales`)"""


def off_nominal(fit: PhysicalFit) -> tuple[OffNominal, ...]:
    """Return the base parameters that significantly differ from nominal by more than the tolerance.

    The largest `OffNominal.score` comes first.
    """
    tolerance, f = fit.structure.profile.tolerance, std_inflation(fit)
    numbers = base_parameters(fit)
    unlike = [c for c in unlike_pair(numbers, tolerance, f) if c.excess(tolerance) > 0]
    out = [
        _off(c, tolerance, f)
        for c in numbers
        if c in unlike
        or c.excess(tolerance) > np.hypot(SCALE_QUANTILE * c.scale, quantile() * f * c.noise_std)
    ]
    return tuple(sorted(out, key=lambda o: -o.score))


def unlike_pair(
    numbers: Sequence[BaseParameter], tolerance: float, f: float
) -> tuple[BaseParameter, ...]:
    """Return the two parameters with the largest and the smallest x, if K_f cannot explain both.

    x = ln(X/X_nominal). The result is empty if a value of K_f may put both parameters within the
    tolerance. The last equation of the module gives the condition. ``f``: its factor f.
    """
    low, high = (pick(numbers, key=lambda c: c.x) for pick in (min, max))
    most = float(np.log1p(tolerance) - np.log1p(-tolerance))
    noise = quantile() * f * np.hypot(low.noise_std, high.noise_std)
    return (low, high) if high.x - low.x > most + noise else ()


def std_inflation(fit: PhysicalFit) -> float:
    """Return the factor f by which `off_nominal` multiplies standard deviations due to noise.

    The factor is `STD_INFLATION` if the fit only maximises the likelihood. It is 1 for a fit to
    free-run predictions, and for a fit that also matches edge rates (how often encoder counts
    change).
    """
    by_likelihood = isinstance(fit, CorrectedFit) and fit.covariance_with_edge_rates is None
    return STD_INFLATION if by_likelihood else 1.0


def _off(c: BaseParameter, tolerance: float, f: float) -> OffNominal:
    ratio, ratio_std = c.value / c.nominal, c.std / abs(c.nominal)
    score = ((c.value - c.nominal) / c.std) ** 2
    flight_score = float((c.x / c.noise_std) ** 2) if c.noise_std > 0 else 0.0
    confidence = float(normal_cdf(c.excess(tolerance) / np.hypot(c.scale, f * c.noise_std)))
    cause = term(FINDINGS[c.name])
    if c.name == "T_g":
        return OffNominal(cause, c.value - c.nominal, c.std, score, confidence, flight_score)
    return OffNominal(cause, ratio, ratio_std, score, confidence, flight_score)


def effect_size(fit: PhysicalFit, name: str) -> tuple[float, float] | None:
    """Return (v − v_0, σ) for a term's first parameter, estimated as v ± σ.

    v_0 is its value without the effect. The result is None if the fit lacks the term, or if v is on
    a logarithmic scale, which has no v_0.
    """
    j = first_parameters(fit.free).get(name)
    if j is None or fit.free[j].log:
        return None
    return float(fit.values[j]) - fit.free[j].null, float(fit.std[j])


def in_SI(fit: PhysicalFit, scale: ThrustScale, name: str) -> dict[str, tuple[float, float]]:
    """Return {parameter: (value, standard deviation)} of the effect ``name``, in SI.

    ``scale`` converts fitted values that are in units of the thrust gain K_f.
    """
    return {
        f.name.removeprefix(f"{name}."): scale.to_si(float(v), float(s), f.unit)
        for f, v, s in zip(fit.free, fit.values, fit.std, strict=True)
        if f.term == name
    }
