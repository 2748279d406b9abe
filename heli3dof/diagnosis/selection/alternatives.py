"""Replace a rejected cause by another candidate of its step.

1. **Its model cannot be flown** (`first_that_flies`): flights simulated from the bias-corrected fit
   diverge from the recorded one. The next likeliest candidate replaces it. If an end stop held the
   arm, this refutes nothing, because simulations have no stop: the uncorrected fit is kept.
2. **It does not pay on held-out data** (`alternatives`): the causes confounded with it are fitted
   in its place and measured on the same data. They remain confounded with it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Set
from dataclasses import replace

import numpy as np

from heli3dof.diagnosis.estimate.bias_correction import CorrectedFit
from heli3dof.diagnosis.estimate.corrected_maximum import maximise_corrected
from heli3dof.diagnosis.estimate.setup import Setup
from heli3dof.diagnosis.screening.grid_trials import widened
from heli3dof.diagnosis.selection.candidate_fits import CandidateFit
from heli3dof.diagnosis.selection.select import Choice, best_choice
from heli3dof.diagnosis.selection.steps import Step, bias_corrected, extended

MAX_ALTERNATIVES = 3
"""Most candidates tried per cause; each costs seconds of simulation. Chosen; not derived."""


def first_that_flies(
    setup: Setup,
    step: Step,
    first_score: float | None,
    made: Mapping[str, CorrectedFit] | None = None,
) -> tuple[Choice | None, CorrectedFit | None]:
    """Return the first candidate of a step whose model can be flown, and its fit.

    (None, None) if there is none. ``made``: existing fits by candidate.
    """
    choice = step.choice
    fits: tuple[CandidateFit, ...] = () if choice is None else choice.contenders
    for _ in range(MAX_ALTERNATIVES):
        if choice is None:
            break
        wider = (made or {}).get(choice.term.name) or extended(setup, choice)
        if wider.scatter is not None or step.fit.scatter is None or setup.touches_stops:
            return choice, wider
        fits = tuple(f for f in fits if f.term.name != choice.term.name)
        choice = best_choice(step.fit, step.screen, step.nulls, fits, first_score)
    return None, None


def instead(choice: Choice, other: CandidateFit) -> Choice:
    """Return the choice with another candidate, confounded with the former; equal confidence."""
    rest = tuple(c for c in choice.contenders if c is not other)
    names = [n for n in (choice.term.name, *choice.tied_with) if n != other.term.name]
    return replace(
        choice, term=other.term, score=other.score, Z2=other.Z2,
        tied_with=tuple(names), contenders=(other, *rest),
    )  # fmt: skip


def alternatives(
    setup: Setup, reduced: CorrectedFit, dropped: Choice, tried: Set[str]
) -> Iterator[tuple[Choice, CorrectedFit]]:
    """Yield causes confounded with ``dropped`` that can be flown, each with its fit.

    ``reduced``: the fit with all other causes. ``tried``: names to skip.
    """
    confounded = [c for c in dropped.contenders if c.term.name in dropped.tied_with]
    for other in [c for c in confounded if c.term.name not in tried][:MAX_ALTERNATIVES]:
        wider = with_candidate(setup, reduced, other)
        if wider.scatter is not None or not setup.controller_is_known:
            yield instead(dropped, other), wider


def with_candidate(setup: Setup, reduced: CorrectedFit, other: CandidateFit) -> CorrectedFit:
    """Return the bias-corrected fit with one more term, started at the candidate's own fit."""
    o = reduced.optimum
    ext = widened(reduced.problem, o.theta, other.term)
    new = other.optimum.theta[-len(other.term.effect.parameters) :]
    fit = maximise_corrected(ext, np.append(o.theta, new), o.noise, None)
    return bias_corrected(setup, ext, fit)
