"""Find effects that an inertia has absorbed, by full fits of candidates with small scores.

In a short step flight, a slow torque has nearly the effect of a wrong inertia. The base fit absorbs
the torque in the inertia J_j; a full fit with the torque returns J_j to nominal. If an inertia is
significantly off nominal (`diagnosis.base_parameters`), terms with Z² > `SIGMAS_95`² are fitted in
full, at most `MAX_FITS`. A term is confounded with the inertias if its score exceeds −`TIE` and its
fit puts all of them within the profile's tolerance ε: ln(1 − ε) ≤ ln(J_j/J_j,nominal) ≤ ln(1 + ε).
"""

from __future__ import annotations

from heli3dof.diagnosis.base_parameters import (
    base_parameters,
    finding_of,
    off_nominal,
)
from heli3dof.diagnosis.constants import SIGMAS_95, TIE
from heli3dof.diagnosis.screening.screening import Screening
from heli3dof.diagnosis.selection.candidate_fits import CandidateFit, fit_candidates
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.model.effects import Term

MAX_FITS = 6
"""Most candidates fitted in full. Chosen; not derived."""


def instead_of_inertia(s: Screening) -> list[CandidateFit]:
    """Return the fits of candidates that bring all inertias off nominal back within tolerance.

    The result is empty if no inertia is off nominal.
    """
    off = [o.term.name for o in off_nominal(s.fit)]
    inertias = {n for n in off if n.startswith("inertia")}
    if not inertias:
        return []
    fits = fit_candidates(s, possible_alternatives(s))
    likely = (f for f in fits if f.score > -TIE)
    return [f for f in likely if within(Estimate(f.problem, f.optimum), inertias)]


def possible_alternatives(s: Screening) -> list[tuple[Term, float, int]]:
    """Return at most `MAX_FITS` ranked, identifiable terms with Z² > `SIGMAS_95`², to fit."""
    hidden = s.not_identifiable
    shown = (r for r in s.ranked if r[1] > SIGMAS_95**2 and r[0].name not in hidden)
    return [r for r in shown if not r[0].effect.formal][:MAX_FITS]


def within(fit: Estimate, names: set[str]) -> bool:
    """Return True if ``fit`` has the parameters of the findings ``names`` within tolerance."""
    tolerance = fit.structure.profile.tolerance
    named = [c for c in base_parameters(fit) if finding_of(c.name) in names]
    return all(c.excess(tolerance) <= 0 for c in named)
