"""The base's own parameters in SI, and those that are surely off as findings.

A fit gives torques and inertias in units of K_f; `estimate.thrust_scale` says how large
that is. A parameter X is a finding where it is off by more than the profile's ``tolerance`` ε,

    K_f             motor.thrust_gain       gain = K_f/K_f,nominal
    T_g             mass.imbalance          torque_Nm = T_g − T_g,nominal
    an inertia      inertia                 ratio = J/J,nominal

and surely: with x = ln X/X_nominal, its edge e = ln(1 + ε) or ln(1 − ε) on x's side, σ the
flights' own standard deviation of x and σ_k the scale's,

    |x − e| > √((`SURE` σ_k)² + (q σ)²)

σ_k is what the profile is believed to, the same in every flight of a rig; σ is what noise does, and
q its quantile at which one of `FAMILY` parameters is falsely named in a share `FALSE_ALARMS` of
recordings. Where encoders chatter, an estimate by the filter's scores alone scatters up to
`DOUBTED` times what is told of it, and that is taken for σ; a weighed one
(`estimate.edge_rates`) scatters as it says.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from heli3dof.diagnosis.estimate.bias_correction import CorrectedFit
from heli3dof.diagnosis.estimate.setup import FALSE_ALARMS
from heli3dof.diagnosis.estimate.thrust_scale import ThrustScale, thrust_scale
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.model.effects import Term, term

SURE = 2.0
FAMILY = 5
"""K_f, T_g and three inertias"""
DOUBTED = 3.0


@dataclass(frozen=True)
class BaseParameter:
    """One number of the profile, in SI."""

    name: str
    nominal: float
    value: float
    std: float
    unit: str
    told: float = 0.0
    """σ, the flights' share of the relative standard deviation"""
    scale: float = 0.0
    """σ_k, the scale's"""

    @property
    def x(self) -> float:
        """ln X/X_nominal; infinite where the two have different signs."""
        ratio = self.value / self.nominal
        return float(np.log(ratio)) if ratio > 0 else -np.inf

    def beyond(self, tolerance: float) -> float:
        """|x| beyond the edge on its side; negative within."""
        return abs(self.x) - abs(edge(self.x, tolerance))

    def surely(self, beyond: float, quantile: float, told: float) -> bool:
        """Whether that much beyond an edge is more than the scale and ``told`` explain."""
        return beyond > float(np.hypot(SURE * self.scale, quantile * told))


def edge(x: float, tolerance: float) -> float:
    """ln(1 ± ε), on x's side.

    >>> round(edge(0.3, 0.15), 4), round(edge(-0.3, 0.15), 4)
    (0.1398, -0.1625)
    """
    return float(np.log1p(tolerance) if x > 0 else np.log1p(-tolerance))


def quantile() -> float:
    """A normal's, one-sided, at `FALSE_ALARMS` in `FAMILY` parameters.

    >>> round(quantile(), 2)
    3.24
    """
    from scipy.stats import norm

    return float(norm.isf(FALSE_ALARMS / FAMILY))


def base_parameters(found: Estimate) -> tuple[BaseParameter, ...]:
    """K_f, T_g and the three inertias."""
    scale = thrust_scale(found)
    K_f = found.structure.profile.motor.K_f
    out = [
        BaseParameter("K_f", K_f, K_f * scale.k, K_f * scale.k * scale.std, "N/V", 0.0, scale.std)
    ]
    for f, v, s in zip(found.free[:4], found.values[:4], found.std[:4], strict=True):
        value, std = scale.applied(float(v), float(s), f.unit)
        out.append(BaseParameter(f.name, f.start, value, std, f.unit, float(s / abs(v)), scale.std))
    return tuple(out)


@dataclass(frozen=True)
class OffNominal:
    """A finding: one of the base's parameters is not what the profile says."""

    term: Term
    value: float
    std: float
    score: float
    """((value − nominal)/std)²"""
    flight_score: float = 0.0
    """(x/σ)²: the same, were the scale known"""
    tied_with: tuple[str, ...] = ()
    """Causes that may be there in its place (`conclusion.inertia_ties`)"""


def off_nominal(
    found: Estimate,
    *,
    doubted: float = DOUBTED,
    beside: tuple[np.ndarray, np.ndarray] | None = None,
) -> tuple[OffNominal, ...]:
    """What is surely off by more than the profile's tolerance, the surest first.

    ``doubted``: how many times what is told of it σ may be. ``beside``: (4,), (4,) what T_g and the
    inertias are, as a logarithm over ``found``'s, beside a leftover, and its standard deviation; a
    parameter that is within the tolerance there is off by what has no name.
    """
    tolerance = found.structure.profile.tolerance
    out = []
    for j, c in enumerate(base_parameters(found), start=-1):
        if not c.surely(c.beyond(tolerance), quantile(), doubted * c.told):
            continue
        if beside is not None and j >= 0:
            moved = c.x + float(beside[0][j])
            left = (abs(moved) if moved * c.x > 0 else 0.0) - abs(edge(c.x, tolerance))
            if not c.surely(left, quantile(), float(np.hypot(c.told, beside[1][j]))):
                continue
        out.append(_off(c))
    return tuple(sorted(out, key=lambda o: -o.score))


def doubt(found: CorrectedFit) -> float:
    """How many times what is told of its numbers their spread may be; a weighed estimate's is
    measured."""
    return DOUBTED if found.spread is None else 1.0


def finding_of(number: str) -> str:
    """The finding that says a base number is off.

    >>> [finding_of(n) for n in ("K_f", "T_g", "J_yaw")]
    ['motor.thrust_gain', 'mass.imbalance', 'inertia.yaw']
    """
    named = {"K_f": "motor.thrust_gain", "T_g": "mass.imbalance"}
    return named.get(number, f"inertia.{number.removeprefix('J_')}")


def _off(c: BaseParameter) -> OffNominal:
    share, spread = c.value / c.nominal, c.std / abs(c.nominal)
    score = ((c.value - c.nominal) / c.std) ** 2
    alone = float((c.x / c.told) ** 2) if c.told > 0 else 0.0
    cause = term(finding_of(c.name))
    if c.name == "T_g":
        return OffNominal(cause, c.value - c.nominal, c.std, score, alone)
    return OffNominal(cause, share, spread, score, alone)


def in_SI(found: Estimate, scale: ThrustScale, name: str) -> dict[str, tuple[float, float]]:
    """Parameter → (value, standard deviation) of the term of that name, in SI."""
    return {
        f.name.removeprefix(f"{name}."): scale.applied(float(v), float(s), f.unit)
        for f, v, s in zip(found.free, found.values, found.std, strict=True)
        if f.term == name
    }
