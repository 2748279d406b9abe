"""The base's own parameters in SI, and those that are off as findings.

A fit gives torques and inertias in units of K_f; `heli3dof.diagnosis.thrust_scale` says how large
that is. Off by more than the profile's ``tolerance``, surely (two standard deviations):

    K_f             motor.thrust_gain       gain = K_f/K_f,nominal
    T_g             mass.imbalance          torque_Nm = T_g − T_g,nominal
    an inertia      inertia                 ratio = J/J,nominal
"""

from __future__ import annotations

from dataclasses import dataclass

from heli3dof.axes import AXES
from heli3dof.diagnosis.thrust_scale import ThrustScale, thrust_scale
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.model.effects import Term, term

SURE = 2.0


@dataclass(frozen=True)
class Calibrated:
    """One number of the profile, in SI."""

    name: str
    nominal: float
    value: float
    std: float
    unit: str

    @property
    def off(self) -> float:
        """By how much of its nominal value it is off, less `SURE` standard deviations."""
        return (abs(self.value - self.nominal) - SURE * self.std) / abs(self.nominal)


def calibrated(found: Estimate) -> tuple[Calibrated, ...]:
    """K_f, T_g and the three inertias."""
    scale = thrust_scale(found)
    K_f = found.structure.profile.motor.K_f
    out = [Calibrated("K_f", K_f, K_f * scale.k, K_f * scale.k * scale.std, "N/V")]
    for f, v, s in zip(found.free[:4], found.values[:4], found.std[:4], strict=True):
        out.append(Calibrated(f.name, f.start, *scale.applied(float(v), float(s), f.unit), f.unit))
    return tuple(out)


@dataclass(frozen=True)
class Off:
    """A finding: one of the base's parameters is not what the profile says."""

    term: Term
    value: float
    std: float
    score: float
    """((value − nominal)/std)²"""


def off_nominal(found: Estimate) -> tuple[Off, ...]:
    """What is off by more than the profile's tolerance, the surest first."""
    tolerance = found.structure.profile.tolerance
    out = []
    for c in calibrated(found):
        if c.off <= tolerance:
            continue
        share, spread = c.value / c.nominal, c.std / abs(c.nominal)
        score = ((c.value - c.nominal) / c.std) ** 2
        if c.name == "K_f":
            out.append(Off(term("motor.thrust_gain"), share, spread, score))
        elif c.name == "T_g":
            out.append(Off(term("mass.imbalance"), c.value - c.nominal, c.std, score))
        else:
            axis = c.name.removeprefix("J_")
            assert axis in AXES
            out.append(Off(term(f"inertia.{axis}"), share, spread, score))
    return tuple(sorted(out, key=lambda o: -o.score))


def in_SI(found: Estimate, scale: ThrustScale, name: str) -> dict[str, tuple[float, float]]:
    """Parameter → (value, standard deviation) of the term of that name, in SI."""
    return {
        f.name.removeprefix(f"{name}."): scale.applied(float(v), float(s), f.unit)
        for f, v, s in zip(found.free, found.values, found.std, strict=True)
        if f.term == name
    }
