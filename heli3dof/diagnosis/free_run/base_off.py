"""The base's own numbers that are off the profile, where no likelihood was fitted.

T_g + τ̄ (`mass.imbalance` differs by recording; what is off in all of them stands in T_g) and the
inertias, in units of the profile's K_f. With x = ln X/X_nominal, σ its deviation, ε the profile's
``tolerance`` and e = ln(1 ± ε) its edge on x's side, X is a finding where

    |x| − |e| > `SURE` σ                  the whole fit's interval lies beyond the edge
    |x_h| > |e|,  |x_h| > `SEEN` σ_h      each half h of the flights shows it, on the same side,
    |x_1 − x_2| ≤ `APART` √(σ_1² + σ_2²)  and of one size

(`free_run.halves`; without halves nothing is off). The prior is in x: it pulls
towards nominal, so what is found beyond the edge is there in spite of it. Three inertias that are
off by one factor are as well one K_f that is off by its inverse, with T_g off by the same: no
flight tells the two apart, so they are tied with `motor.thrust_gain`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.conclusion.encoder_scales import SCALE
from heli3dof.diagnosis.estimate.base_parameters import BaseParameter, OffNominal
from heli3dof.diagnosis.free_run.halves import APART, SEEN
from heli3dof.diagnosis.result import Finding
from heli3dof.identification.greybox.freeflight import WEIGHT
from heli3dof.identification.greybox.multistep import MultiStepFit
from heli3dof.model.effects import term

SURE = 1.96
BASE = 4
"""T_g and the inertias come first among a structure's numbers."""


def numbers(fit: MultiStepFit) -> tuple[BaseParameter, ...]:
    """T_g with what every recording's weight adds, and the inertias."""
    out = []
    names, C = fit.structure.names, fit.covariance
    for j, f in enumerate(fit.structure.free[:BASE]):
        value, variance = float(fit.values[j]), float(C[j, j])
        if f.name == "T_g" and WEIGHT in names:
            w = names.index(WEIGHT)
            value += float(fit.values[w])
            variance += float(C[w, w] + 2 * C[j, w])
        std = float(np.sqrt(variance))
        out.append(BaseParameter(f.name, f.start, value, std, f.unit, std / abs(value)))
    return tuple(out)


def off_profile(
    whole: MultiStepFit, halves: tuple[MultiStepFit, ...], tolerance: float
) -> tuple[OffNominal, ...]:
    """What is surely off by more than the tolerance, the surest first."""
    if len(halves) < 2:
        return ()
    each = [numbers(h) for h in halves]
    off = [
        _off(c)
        for j, c in enumerate(numbers(whole))
        if sure(c, tolerance) and shown([h[j] for h in each], c.x, tolerance)
    ]
    inertias = [o for o in off if o.term.effect.name == "inertia"]
    if len(inertias) == len(AXES) and one_factor(inertias):
        off = [replace(o, tied_with=(SCALE,)) if o in inertias else o for o in off]
    return tuple(sorted(off, key=lambda o: -o.score))


def merged(
    findings: tuple[Finding, ...], off: tuple[OffNominal, ...]
) -> tuple[tuple[Finding, ...], tuple[OffNominal, ...]]:
    """One finding of each name: a weight that differs by recording, and is off in all, is one."""
    by_name = {o.term.name: o for o in off}
    out = []
    for f in findings:
        if o := by_name.pop(f.choice.term.name, None):
            f = replace(f, values={o.term.effect.parameters[0].name: (o.value, o.std)})
        out.append(f)
    return tuple(out), tuple(o for o in off if o.term.name in by_name)


def sure(c: BaseParameter, tolerance: float) -> bool:
    """Whether the interval lies beyond the edge."""
    return bool(np.isfinite(c.x)) and c.beyond(tolerance) > SURE * c.told


def shown(halves: list[BaseParameter], x: float, tolerance: float) -> bool:
    """Whether each half has it beyond the edge on x's side, surely there, and all of one size."""
    for h in halves:
        if not h.x * x > 0 or h.beyond(tolerance) <= 0 or abs(h.x) < SEEN * h.told:
            return False
    a, b = halves[0], halves[-1]
    return abs(a.x - b.x) <= APART * float(np.hypot(a.told, b.told))


def one_factor(inertias: list[OffNominal]) -> bool:
    """Whether one number explains all three, each within its deviation."""
    x = np.log([o.value for o in inertias])
    told = np.array([o.std / o.value for o in inertias])
    return bool((np.abs(x - x.mean()) <= SURE * told).all())


def _off(c: BaseParameter) -> OffNominal:
    score = ((c.value - c.nominal) / c.std) ** 2
    flights = (c.x / c.told) ** 2
    if c.name == "T_g":
        return OffNominal(term("mass.imbalance"), c.value - c.nominal, c.std, score, flights)
    axis = c.name.removeprefix("J_")
    nominal = abs(c.nominal)
    return OffNominal(term(f"inertia.{axis}"), c.value / c.nominal, c.std / nominal, score, flights)
