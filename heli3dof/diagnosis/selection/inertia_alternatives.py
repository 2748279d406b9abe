"""What an inertia that is off may have swallowed: a full fit where the screen sees too little.

A slow torque drives a short step flight much as another inertia would. The base takes that inertia
and more noise, and beside both the screen's linear look at the torque shows little: it looks from
where the base has moved as far as it can. The full fit knows better: with the torque in it, the
inertia comes back. So where nothing was found, but inertias are surely off
(`estimate.base_parameters`), every term of which the screen saw

    Z² > `SEEN`

is fitted in full (at most `FITTED`), and one with which each of those inertias is within the
profile's tolerance ε,

    ln(1 − ε) ≤ ln J_j/J_j,nominal ≤ ln(1 + ε)

is the cause where its score is `SURELY` times the nulls' threshold, which is one of slopes: the
likeliest of several full fits scatters more. It is tied with the inertia where it is no more than
`TIE` below nothing: neither explains the flight better then.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from heli3dof.diagnosis.estimate.base_parameters import (
    base_parameters,
    finding_of,
    off_nominal,
    std_inflation,
)
from heli3dof.diagnosis.estimate.bias_correction import CorrectedFit
from heli3dof.diagnosis.screening.nulls import Nulls
from heli3dof.diagnosis.screening.score_test import Screen, ScreenResult
from heli3dof.diagnosis.selection.candidate_fits import CandidateFit, fit_candidates
from heli3dof.diagnosis.selection.select import (
    TIE,
    Choice,
    certainty,
    ranked_candidates,
    tie_margin,
    unidentifiable,
)
from heli3dof.identification.greybox.estimate import Estimate

SEEN = 4.0
FITTED = 6
SURELY = 3.0


def instead_of_inertia(
    found: CorrectedFit, screen: Screen, seen: ScreenResult, nulls: Nulls, bias: np.ndarray
) -> list[CandidateFit]:
    """The terms with which the inertias that are surely off in ``found`` are not, best first."""
    off = [o.term.name for o in off_nominal(found, std_inflation=std_inflation(found))]
    inertias = {n for n in off if n.startswith("inertia")}
    if not inertias:
        return []
    hidden = unidentifiable(screen, nulls)
    every = [r for r in ranked_candidates(seen, nulls) if r[1] > SEEN and r[0].name not in hidden]
    plain = [r for r in every if not r[0].effect.formal][:FITTED]
    fits = fit_candidates(found, screen, seen, nulls, bias, plain)
    back = [f for f in fits if within(Estimate(f.problem, f.optimum), inertias)]
    # What the screen saw of it is too little: the full fit is what was seen.
    return [replace(f, Z2=f.score) for f in back if f.score > -TIE]


def within(found: Estimate, names: set[str]) -> bool:
    """Whether each of the base's numbers with one of these findings' names is within tolerance."""
    tolerance = found.structure.profile.tolerance
    asked = [c for c in base_parameters(found) if finding_of(c.name) in names]
    return all(c.beyond(tolerance) <= 0 for c in asked)


def cause_hidden_in_inertia(
    fits: Sequence[CandidateFit], screen: Screen, nulls: Nulls
) -> Choice | None:
    """The cause among `instead_of_inertia`, where its full fit is surely beyond the threshold."""
    if not fits or fits[0].score < SURELY * nulls.threshold:
        return None
    best, *rest = fits
    tied = tuple(
        f.term.name for f in rest if best.score - f.score < tie_margin(screen, nulls, best, f)
    )
    sure = certainty([best.score, *[f.score for f in rest[:1]], 0.0])
    return Choice(
        best.term, best.score, best.Z2, sure, tied, tuple(fits), threshold=nulls.threshold
    )
