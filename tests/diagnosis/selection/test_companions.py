"""Of confounded causes, the one that explains more together with a second cause is chosen."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from heli3dof.diagnosis.estimate.base_fit import fit_base
from heli3dof.diagnosis.estimate.setup import Setup
from heli3dof.diagnosis.selection import companions
from heli3dof.diagnosis.selection.candidate_fits import CandidateFit
from heli3dof.diagnosis.selection.companions import (
    MIN_PAIR_W,
    best_with_companion,
    comparable,
    nulls_for,
    single_cause,
)
from heli3dof.diagnosis.selection.rivals import LARGE_BIAS
from heli3dof.diagnosis.selection.select import TIE, Choice
from heli3dof.diagnosis.selection.steps import extended, screening_step
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import load_plan
from heli3dof.model.effects import terms

NONE = cast(Any, None)
LEVEL = SimpleNamespace(theta=None, noise=None)
NAMES = ("motor.supply_sag", "motor.thrust_curve", "motor.saturation")


def step_with(tied_with: tuple[str, ...], bias: float = 0.0) -> Any:
    fits = tuple(
        CandidateFit(t, NONE, NONE, s, 50.0, i)
        for i, (t, s) in enumerate(zip(terms(NAMES), (120.0, 118.0, 20.0), strict=True))
    )
    nulls = SimpleNamespace(mean=np.array([bias, 0.0, 0.0]), inflation=1.0)
    made = Choice(fits[0].term, 120.0, 50.0, 0.7, tied_with, fits)
    return SimpleNamespace(choice=made, nulls=nulls)


@pytest.fixture
def companion_scores(monkeypatch: pytest.MonkeyPatch) -> dict[str, float]:
    """Score of the likeliest second term with each name; tests fill it. Nothing is fitted."""
    scores: dict[str, float] = {}

    def fake_extended(setup: object, choice: Choice) -> Any:
        return SimpleNamespace(scatter=np.eye(1), name=choice.contenders[0].term.name)

    def companion(step: object, setup: object, pair: Any) -> Any:
        score = scores.get(pair.name)
        return None if score is None else SimpleNamespace(score=score, problem=None, optimum=LEVEL)

    monkeypatch.setattr(companions, "single_cause", lambda setup, pair, alone: None)
    monkeypatch.setattr(companions, "extended", fake_extended)
    monkeypatch.setattr(companions, "companion", companion)
    return scores


@pytest.mark.parametrize(
    ("sag", "curve", "taken"),
    [
        (None, None, NAMES[0]),
        (None, 2.0 + TIE + 1, NAMES[1]),  # 118 + 9 > 120 + TIE
        (None, 2.0 + TIE - 1, NAMES[0]),
        (40.0, 45.0, NAMES[0]),  # 160 against 163
        (None, -8.0, NAMES[0]),  # no companion pays for its parameter
    ],
)
def test_the_second_term_decides_between_confounded_causes(
    companion_scores: dict[str, float], sag: float | None, curve: float | None, taken: str
) -> None:
    companion_scores |= {
        n: s for n, s in zip(NAMES[:2], (sag, curve), strict=True) if s is not None
    }
    chosen, made = best_with_companion(NONE, step_with(NAMES[1:2]))
    assert chosen.term.name == taken
    assert {chosen.term.name, *chosen.tied_with} == set(NAMES[:2])
    assert set(made) == set(NAMES[:2])


@pytest.mark.parametrize(
    ("W", "taken"), [(MIN_PAIR_W + 0.1, NAMES[1]), (MIN_PAIR_W - 0.1, NAMES[0])]
)
def test_a_pair_replaces_a_single_cause_only_if_clearly_likelier(
    monkeypatch: pytest.MonkeyPatch, companion_scores: dict[str, float], W: float, taken: str
) -> None:
    monkeypatch.setattr(companions, "single_cause", single_cause)
    monkeypatch.setattr(companions, "correct", lambda *fit, **how: None)
    monkeypatch.setattr(companions, "likelihoods", lambda fits, flown, *, seed: (fits, flown))
    monkeypatch.setattr(companions, "odds", lambda *_: np.array([[0.0, W], [-W, 0.0]]))
    companion_scores[NAMES[1]] = 80.0
    chosen, _ = best_with_companion(Setup((), 0, 4), step_with(NAMES[1:2]))
    assert chosen.term.name == taken
    assert {chosen.term.name, *chosen.tied_with} == set(NAMES[:2])


def test_a_cause_that_is_not_confounded_needs_no_fit(companion_scores: dict[str, float]) -> None:
    step = step_with(())
    chosen, made = best_with_companion(NONE, step)
    assert chosen is step.choice
    assert not made


def test_scores_with_large_bias_are_not_compared() -> None:
    assert len(comparable(step_with(NAMES[1:2], bias=LARGE_BIAS - 0.1))) == 2
    assert len(comparable(step_with(NAMES[1:2], bias=LARGE_BIAS + 0.1))) == 1


def test_a_dead_zone_is_found_together_with_the_supply_sag() -> None:
    """A dead zone of 1.5 V removes a fifth of the thrust at 7.5 V (hover), the sag 9 %."""
    device = "mock:?speed=max&seed=1203&hide=motor.dead_zone:1.5,motor.supply_sag:0.006"
    flown = fly_plan(load_plan("rich"), device=device, seed=1203).recording
    setup = Setup((flown,), 0, 4)
    step = screening_step(setup, fit_base(setup), 10)
    assert nulls_for(step, step.screen).mean == pytest.approx(step.nulls.mean)
    step = step.chosen(Setup((flown,), 0, 4, "rigid", False), None)
    assert step.choice is not None
    one = next(c for c in step.choice.contenders if c.term.name == "motor.supply_sag")
    alone = extended(setup, Choice(one.term, 0.0, 0.0, 0.0, (), (one,)))
    other = companions.companion(step, setup, alone)
    assert other is not None
    assert other.term.name == "motor.dead_zone"
    assert other.score > 20
