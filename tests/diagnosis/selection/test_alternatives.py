"""Alternatives to a rejected cause: the causes confounded with it are tried in its place."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from heli3dof.diagnosis.selection import alternatives as module
from heli3dof.diagnosis.selection import select
from heli3dof.diagnosis.selection.alternatives import MAX_ALTERNATIVES, first_that_flies, instead
from heli3dof.diagnosis.selection.candidate_fits import CandidateFit
from heli3dof.diagnosis.selection.select import TIE, Choice
from heli3dof.model.effects import terms

NONE = cast(Any, None)
FREE = cast(Any, SimpleNamespace(touches_stops=False))
HELD = cast(Any, SimpleNamespace(touches_stops=True))
NAMES = ("aero.inflow", "friction.viscous.roll", "drag.quadratic.roll", "motor.supply_sag")
THRESHOLD = 20.0


def contender(name: str, score: float, Z2: float = 50.0) -> CandidateFit:
    return CandidateFit(terms([name])[0], NONE, NONE, score, Z2, 0)


def choice(*fits: CandidateFit, tied: int = 0) -> Choice:
    """The first fit, confounded with that many of the others."""
    best = fits[0]
    names = tuple(f.term.name for f in fits[1 : 1 + tied])
    return Choice(best.term, best.score, best.Z2, 0.9, names, fits)


def step_with(made: Choice) -> Any:
    nulls = SimpleNamespace(
        threshold=THRESHOLD, confidence=lambda Z2: 1.0, least=lambda _: THRESHOLD
    )
    return SimpleNamespace(
        choice=made, screen=NONE, nulls=nulls, fit=SimpleNamespace(scatter=np.eye(1))
    )


@pytest.fixture
def unflyable(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of causes whose model cannot be flown; tests fill it."""
    names: list[str] = []

    def extended(setup: object, made: Choice) -> Any:
        return SimpleNamespace(scatter=None if made.term.name in names else np.eye(1))

    monkeypatch.setattr(module, "extended", extended)
    monkeypatch.setattr(select, "tie_margin", lambda *a: TIE)
    return names


FITS = tuple(contender(n, s) for n, s in zip(NAMES, (500.0, 300.0, 297.0, 90.0), strict=True))


def test_a_cause_that_flies_is_kept(unflyable: list[str]) -> None:
    made = choice(*FITS)
    taken, fit = first_that_flies(FREE, step_with(made), None)
    assert taken is made
    assert fit is not None


def test_an_unflyable_cause_is_replaced_by_the_next_likeliest_and_not_confounded_with_it(
    unflyable: list[str],
) -> None:
    unflyable += NAMES[:1]
    taken, _ = first_that_flies(FREE, step_with(choice(*FITS)), None)
    assert taken is not None
    assert taken.term.name == NAMES[1]
    assert taken.tied_with == NAMES[2:3]  # its score is 3 less, within TIE
    assert NAMES[0] not in [c.term.name for c in taken.contenders]


def test_no_cause_is_taken_if_none_flies_or_the_rest_is_below_the_threshold(
    unflyable: list[str],
) -> None:
    unflyable += NAMES[:MAX_ALTERNATIVES]
    assert first_that_flies(FREE, step_with(choice(*FITS)), None) == (None, None)
    below = contender(NAMES[3], 90.0, Z2=THRESHOLD - 1)
    assert first_that_flies(FREE, step_with(choice(FITS[0], below)), None) == (None, None)


def test_with_an_unknown_controller_the_first_cause_is_kept(unflyable: list[str]) -> None:
    unflyable += NAMES
    step = step_with(choice(*FITS))
    step.fit.scatter = None
    taken, _ = first_that_flies(FREE, step, None)
    assert taken is step.choice


def test_a_flight_held_by_a_stop_refutes_no_cause(
    unflyable: list[str],
) -> None:
    unflyable += NAMES[:1]
    step = step_with(choice(*FITS))
    assert first_that_flies(HELD, step, None)[0] is step.choice


def test_an_existing_fit_is_reused(unflyable: list[str]) -> None:
    fit = cast(Any, SimpleNamespace(scatter=np.eye(2)))
    taken = first_that_flies(FREE, step_with(choice(*FITS)), None, {NAMES[0]: fit})
    assert taken[1] is fit


def test_a_replacement_is_confounded_with_the_original_at_the_same_confidence() -> None:
    close = [contender(n, 50.0) for n in NAMES[:3]]
    before = choice(*close, tied=2)
    new = instead(before, close[1])
    assert (new.term.name, new.tied_with) == (NAMES[1], (NAMES[0], NAMES[2]))
    assert new.confidence == before.confidence
    assert new.contenders[0] is close[1]
