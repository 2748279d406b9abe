"""Find base parameters outside the profile's tolerance, for logs without a usable likelihood.

The base parameters X are the three inertias and T_g + τ̄, in units of the profile's K_f. τ̄ is the
mean of `mass.imbalance` over the recordings. Let x = ln X/X_nominal, σ its standard deviation,
ε the profile's ``tolerance`` and e = ln(1 ± ε) on x's side. X is a finding if all of these hold:

    |x| − |e| > `SURE` σ                         whole fit: 95 % interval beyond the tolerance
    |x_h| > |e|,  |x_h| ≥ `SIGNIFICANT` σ_h      each half h of the flights (`free_run.halves`)
    |x_1 − x_2| ≤ `CONSISTENT` √(σ_1² + σ_2²)    both halves: one size, on x's side

The prior pulls x towards zero, so it cannot cause a finding. A common factor of the inertias is
indistinguishable from its inverse as a factor of K_f. If one factor explains all three, they are
confounded with `motor.thrust_gain`; T_g is not compared.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.conclusion.encoder_scales import SCALE
from heli3dof.diagnosis.estimate.base_parameters import BaseParameter, OffNominal
from heli3dof.diagnosis.free_run.halves import CONSISTENT, SIGNIFICANT
from heli3dof.diagnosis.result import Finding
from heli3dof.identification.greybox.freeflight import WEIGHT
from heli3dof.identification.greybox.multistep import MultiStepFit
from heli3dof.model.effects import term

SURE = 1.96
"""Two-sided 95 % quantile of the normal distribution"""
BASE = 4
"""Number of base parameters (T_g, three inertias); they come first in a structure."""


def fitted_base(fit: MultiStepFit) -> tuple[BaseParameter, ...]:
    """Return T_g + τ̄ and the inertias, with their standard deviations."""
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
    """Return the base parameters outside the tolerance, by falling score."""
    if len(halves) < 2:
        return ()
    each = [fitted_base(h) for h in halves]
    off = [
        _off(c)
        for j, c in enumerate(fitted_base(whole))
        if beyond_tolerance(c, tolerance) and halves_confirm([h[j] for h in each], c.x, tolerance)
    ]
    inertias = [o for o in off if o.term.effect.name == "inertia"]
    if len(inertias) == len(AXES) and one_factor(inertias):
        off = [replace(o, tied_with=(SCALE,)) if o in inertias else o for o in off]
    return tuple(sorted(off, key=lambda o: -o.score))


def merged(
    findings: tuple[Finding, ...], off: tuple[OffNominal, ...]
) -> tuple[tuple[Finding, ...], tuple[OffNominal, ...]]:
    """Return both lists without duplicates; a finding that is also in ``off`` takes its value."""
    by_name = {o.term.name: o for o in off}
    out = []
    for f in findings:
        if o := by_name.pop(f.choice.term.name, None):
            f = replace(f, values={o.term.effect.parameters[0].name: (o.value, o.std)})
        out.append(f)
    return tuple(out), tuple(o for o in off if o.term.name in by_name)


def beyond_tolerance(c: BaseParameter, tolerance: float) -> bool:
    """Return whether the 95 % interval of x lies beyond the limit."""
    return bool(np.isfinite(c.x)) and c.beyond(tolerance) > SURE * c.noise_std


def halves_confirm(halves: list[BaseParameter], x: float, tolerance: float) -> bool:
    """Return whether each half is significant and beyond the limit on x's side, with one size."""
    for h in halves:
        if not h.x * x > 0 or h.beyond(tolerance) <= 0 or abs(h.x) < SIGNIFICANT * h.noise_std:
            return False
    a, b = halves[0], halves[-1]
    return abs(a.x - b.x) <= CONSISTENT * float(np.hypot(a.noise_std, b.noise_std))


def one_factor(inertias: list[OffNominal]) -> bool:
    """Return whether one factor explains all inertias, each within `SURE` standard deviations."""
    x = np.log([o.value for o in inertias])
    std = np.array([o.std / o.value for o in inertias])
    return bool((np.abs(x - x.mean()) <= SURE * std).all())


def _off(c: BaseParameter) -> OffNominal:
    score = ((c.value - c.nominal) / c.std) ** 2
    flights = (c.x / c.noise_std) ** 2
    if c.name == "T_g":
        return OffNominal(term("mass.imbalance"), c.value - c.nominal, c.std, score, flights)
    axis = c.name.removeprefix("J_")
    nominal = abs(c.nominal)
    return OffNominal(term(f"inertia.{axis}"), c.value / c.nominal, c.std / nominal, score, flights)
