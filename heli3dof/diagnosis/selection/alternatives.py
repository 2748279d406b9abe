"""The causes that one which fails was chosen over, tried in its place.

One cause is taken first, by a margin that chance or a formula may have made. It can fail
afterwards. The rig with it, freed of its bias, may be one that the controller cannot fly, though
the recording was flown: then it is refuted, and the likeliest of the others is chosen as if it had
never stood there (`selection.select.best_choice`). Where a stop held the arm, of which those
flights know nothing, they refute nothing, and it is taken by its likelihood alone. Or it does not
pay on data that it has not seen: that refutes none of those that it is tied with, which are asked
by the same data, each settled beside all else that was found. What stands is tied with what it
replaces, which those data need not have told from it.
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

TURNS = 3
"""Causes that are asked in the place of one, at most; each is flown or measured anew, seconds."""


def first_that_flies(
    bench: Setup,
    step: Step,
    first_score: float | None,
    made: Mapping[str, CorrectedFit] | None = None,
) -> tuple[Choice | None, CorrectedFit | None]:
    """The cause of a step that made a choice, and the fit with it; where that rig could not have
    been flown, the likeliest of the other contenders, and nothing where that holds of `TURNS`.
    ``made``: fits with a contender, by its name, that are there already."""
    choice = step.choice
    fits: tuple[CandidateFit, ...] = () if choice is None else choice.contenders
    for _ in range(TURNS):
        if choice is None:
            break
        wider = (made or {}).get(choice.term.name) or extended(bench, choice)
        if wider.scatter is not None or step.found.scatter is None or bench.touches_stops:
            return choice, wider
        fits = tuple(f for f in fits if f.term.name != choice.term.name)
        choice = best_choice(step.found, step.screen, step.nulls, fits, first_score)
    return None, None


def instead(choice: Choice, other: CandidateFit) -> Choice:
    """The same step with another of its contenders taken: tied as before, and as sure."""
    rest = tuple(c for c in choice.contenders if c is not other)
    names = [n for n in (choice.term.name, *choice.tied_with) if n != other.term.name]
    return replace(
        choice, term=other.term, score=other.score, Z2=other.Z2,
        tied_with=tuple(names), contenders=(other, *rest),
    )  # fmt: skip


def alternatives(
    bench: Setup, less: CorrectedFit, gone: Choice, asked: Set[str]
) -> Iterator[tuple[Choice, CorrectedFit]]:
    """What ``gone`` was tied with and was not asked yet, each beside ``less``, the fit of all other
    causes; what could not have been flown is passed over."""
    near = [c for c in gone.contenders if c.term.name in gone.tied_with]
    for other in [c for c in near if c.term.name not in asked][:TURNS]:
        wider = replaced(bench, less, other)
        if wider.scatter is not None or not bench.controller_is_known:
            yield instead(gone, other), wider


def replaced(bench: Setup, less: CorrectedFit, other: CandidateFit) -> CorrectedFit:
    """The fit with one term more, which begins where it was found; settled."""
    o = less.optimum
    ext = widened(less.problem, o.theta, other.term)
    new = other.optimum.theta[-len(other.term.effect.parameters) :]
    fit = maximise_corrected(ext, np.append(o.theta, new), o.noise, None)
    return bias_corrected(bench, ext, fit)
