"""Report effects confounded with a wrong inertia, trim torque T_g or thrust gain K_f.

The base fit absorbs some effects completely. For example, a step about one hover voltage only
determines the ratio of thrust slope and inertia, so a curved thrust appears as another inertia.

A probe i is an effect of a trial size. It changes the base fit's scaled parameter θ_j of T_g or an
inertia by b_ji = (A⁻¹ T W δc_i)_j (symbols: `screening.score_test`). θ_edge is the limit that the
profile's tolerance sets for θ_j. If effect i alone explains why θ_j exceeds θ_edge, its size α (in
units of the probe) and its statistic Z are at least

    α = (θ_j − θ_edge)/b_ji,        Z = α √v_i / std_i

and at most those for the opposite limit. v_i is the information of probe i, std_i the standard
deviation of its score in simulated flights without the effect. Effect i is confounded with
parameter j if

1. α is possible: at most `LARGE` typical sizes, and of the right sign;
2. the measured Z_i lies within this range of Z, widened by `SIGMAS_99`.

A wrong K_f scales all four parameters alike (`greybox.thrust_scale`). For K_f the same conditions
apply with another range of α: the corrected parameters θ_j − α b_ji must give a K_f within the
tolerance.

In a short step flight, a slow torque has nearly the effect of a wrong inertia. The base fit absorbs
the torque in the inertia J_j; a full fit with the torque returns J_j to nominal. If an inertia is
significantly off nominal (`diagnosis.base_parameters`), terms with Z² > `SIGMAS_95`² are fitted in
full, at most `MAX_FITS`. A term is confounded with the inertias off nominal if both hold:

- Its BIC score (`selection.candidate_fits`) exceeds −`TIE`.
- Its fit puts all these inertias within the profile's tolerance ε: ln(1 − ε) ≤ ln(J_j/J_j,nominal)
  ≤ ln(1 + ε).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from heli3dof.diagnosis.base_parameters import (
    THRUST_GAIN,
    OffNominal,
    base_parameters,
    finding_of,
    off_nominal,
)
from heli3dof.diagnosis.constants import LARGE, SIGMAS_95, SIGMAS_99, TIE
from heli3dof.diagnosis.screening.screening import Screening, one_sided
from heli3dof.diagnosis.selection.candidate_fits import CandidateFit, fit_candidates
from heli3dof.diagnosis.selection.select import with_ties
from heli3dof.diagnosis.selection.steps import Step
from heli3dof.identification.bias_correction.correction import CorrectedFit
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.thrust_scale import edge, of_ratios, thrust_scale
from heli3dof.model.effects import Term

MAX_FITS = 6
"""Most candidates fitted in full. Chosen; not derived."""
SIZES = 21
"""Number of trial sizes, from zero to the largest. Chosen; not derived."""
PARAMETERS = ("mass.imbalance", "inertia.roll", "inertia.pitch", "inertia.yaw")
"""Findings, in the order of the base's free parameters"""


def with_confounded_causes(off: Sequence[OffNominal], step: Step) -> tuple[OffNominal, ...]:
    """Return ``off``; the ``tied_with`` of each names the effects that are confounded with it."""
    is_inertia = [o.term.effect.name == "inertia" for o in off]
    alternatives = [f.term.name for f in instead_of_inertia(step)] if any(is_inertia) else []

    def confounded(o: OffNominal) -> tuple[str, ...]:
        if o.term.name == THRUST_GAIN:
            return confounded_with_thrust_gain(step)
        return confounded_causes(step, PARAMETERS.index(o.term.name))

    return tuple(
        with_ties(o, (*confounded(o), *alternatives * with_fits))
        for o, with_fits in zip(off, is_inertia, strict=True)
    )


def last_step_with_causes(steps: Sequence[Step], fit: CorrectedFit) -> Step:
    """Return the last step whose fit has the same terms as ``fit``.

    If no step has these terms, the result is the last of all steps.
    """
    names = {t.name for t in fit.structure.terms}
    same = (s for s in reversed(steps) if {t.name for t in s.fit.structure.terms} == names)
    return next(same, steps[-1])


def confounded_causes(step: Step, j: int) -> tuple[str, ...]:
    """Return the terms confounded with base parameter j, an index of `PARAMETERS`."""
    fit, screen = step.fit, step.screen
    f, value = fit.free[j], float(fit.values[j]) * thrust_scale(fit).k
    if value / f.start <= 0:
        return ()
    x, v = float(np.log(value / f.start)), float(fit.values[j])
    tolerance = fit.structure.profile.tolerance
    same_side, other_side = (float(np.exp(edge(s, tolerance) - x)) for s in (x, -x))
    least, most = (
        f.scaled(v) - f.scaled(v * same_side),
        f.scaled(v) - f.scaled(v * other_side),
    )
    solved = enumerate(screen.solved[j, : len(screen.plain)])
    return plausible_terms(step, ((i, least / b, most / b) for i, b in solved if b))


def confounded_with_thrust_gain(step: Step) -> tuple[str, ...]:
    """Return the terms confounded with the thrust gain K_f."""
    fit, screen = step.fit, step.screen
    base, half = fit.free[:4], 0.5 * fit.structure.profile.tolerance
    nominal = np.array([f.start for f in base])
    std = fit.std[:4] / np.abs(nominal)
    at = np.array([f.scaled(float(v)) for f, v in zip(base, fit.values, strict=False)])

    def log_k(amount: float, b: np.ndarray) -> float:
        x = np.array([f.unscaled(float(c)) for f, c in zip(base, at - amount * b, strict=True)])
        return float(np.log(of_ratios(x / nominal, std, half).k))

    limit = abs(edge(log_k(0.0, np.zeros(4)), fit.structure.profile.tolerance))

    def size_ranges(i: int) -> list[tuple[float, float]]:
        """Return ranges (least, most) of the size α of probe ``i``, at most one per sign of α.

        With α in a range, the probe's effect alone explains a wrong K_f: the parameters corrected
        for it give a K_f within the profile's tolerance.
        """
        p, b = screen.plain[i], screen.solved[:4, i]
        largest = LARGE * p.term.effect.parameters[0].typical / abs(p.size)
        sizes = np.linspace(0.0, largest, SIZES)[1:]
        by_sign = [[s * a for a in sizes if abs(log_k(s * a, b)) < limit] for s in (1.0, -1.0)]
        return [(a[0], a[-1]) for a in by_sign if a]

    grow = [i for i, p in enumerate(screen.plain) if p.grows]
    return plausible_terms(step, ((i, *a) for i in grow for a in size_ranges(i)))


def plausible_terms(step: Step, ranges: Iterable[tuple[int, float, float]]) -> tuple[str, ...]:
    """Return the names of the terms with a probe that meets the module's conditions 1 and 2.

    ``ranges``: (probe index i, least α, largest α). With a size α in this range, the effect of
    probe i alone explains the wrong parameter. α is in units of the probe.
    """
    screen, Z = step.screen, step.Z

    def is_plausible(i: int, least: float, most: float) -> bool:
        p = screen.plain[i]
        if (
            p.term.effect.formal
            or not p.grows
            or not np.isfinite(screen.v[i])
            or (least < 0 and one_sided(p))
        ):
            return False
        largest = LARGE * p.term.effect.parameters[0].typical * (1 + 1e-9)
        if abs(least * p.size) > largest:
            return False
        most = np.clip(most, -largest / abs(p.size), largest / abs(p.size))
        z_per_unit = float(np.sqrt(screen.v[i])) / float(step.nulls.std[i])
        low, high = sorted((least * z_per_unit, most * z_per_unit))
        return bool(low - SIGMAS_99 < float(Z[i]) < high + SIGMAS_99)

    return tuple(dict.fromkeys(screen.plain[i].name for i, *a in ranges if is_plausible(i, *a)))


def instead_of_inertia(s: Screening) -> list[CandidateFit]:
    """Return the fits of candidates that may replace the deviations of all inertias off nominal.

    In such a fit, these inertias are within the profile's tolerance. The result is empty if no
    inertia is off nominal.
    """
    off = [o.term.name for o in off_nominal(s.fit)]
    inertias = {n for n in off if n.startswith("inertia")}
    if not inertias:
        return []
    fits = fit_candidates(s, possible_alternatives(s))
    likely = (f for f in fits if f.score > -TIE)
    return [f for f in likely if are_within_tolerance(Estimate(f.problem, f.optimum), inertias)]


def possible_alternatives(s: Screening) -> list[tuple[Term, float, int]]:
    """Return the entries of `Screening.ranked` to fit as alternatives to a wrong inertia.

    These are the first `MAX_FITS` identifiable terms with Z² > `SIGMAS_95`².
    """
    hidden = s.not_identifiable
    shown = (r for r in s.ranked if r[1] > SIGMAS_95**2 and r[0].name not in hidden)
    return [r for r in shown if not r[0].effect.formal][:MAX_FITS]


def are_within_tolerance(fit: Estimate, names: set[str]) -> bool:
    """Return True if base parameters of ``fit`` are all within the profile's tolerance.

    ``names``: the parameters, by the names of their findings, such as ``inertia.roll``.
    """
    tolerance = fit.structure.profile.tolerance
    named = [c for c in base_parameters(fit) if finding_of(c.name) in names]
    return all(c.excess(tolerance) <= 0 for c in named)
