"""Replace a cause whose model cannot be flown by the next likeliest candidate of its step.

Flights simulated from the bias-corrected fit diverge from the recorded one then. If an end stop
held the arm, this refutes nothing, because simulations have no stop: the uncorrected fit is kept.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from heli3dof.diagnosis.estimate.bias_correction import CorrectedFit
from heli3dof.diagnosis.estimate.setup import Setup
from heli3dof.diagnosis.selection.candidate_fits import CandidateFit
from heli3dof.diagnosis.selection.select import Choice, best_choice
from heli3dof.diagnosis.selection.steps import Step, extended

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
