"""If the score bias is large, flights simulated from each rival decide between them."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.stats import t

from heli3dof.diagnosis.search import rivals as module
from heli3dof.diagnosis.search.candidate_fits import CandidateFit
from heli3dof.diagnosis.search.rivals import compared_by_simulation, least_odds, odds, rivals
from heli3dof.diagnosis.search.select import Choice
from heli3dof.diagnosis.search.steps import screening_step
from heli3dof.experiment.plan import step_plan
from heli3dof.identification.closed_loop_fit.base_fit import fit_base
from heli3dof.identification.closed_loop_fit.setup import Setup
from tests.flown import flown


def likelihoods(m0: float, m1: float, s: float) -> np.ndarray:
    """Return ℓ (2, 4, 2) of two rivals' flights; ℓ_1 − ℓ_0 has means m0, m1 and deviation s."""
    out = np.zeros((2, 4, 2))
    out[0, :, 1] = m0 + s * np.array([-1, -1, 1, 1]) * np.sqrt(3) / 2
    out[1, :, 1] = m1 + s * np.array([-1, -1, 1, 1]) * np.sqrt(3) / 2
    return out


def test_the_rival_whose_flights_match_the_recording_is_likelier() -> None:
    # By hand: s = 5 √(5/4); the recording's 10 is the second rival's mean, 30 above the first's.
    W = odds(np.array([0.0, 10.0]), likelihoods(-20.0, 10.0, 5.0))
    by_hand = 2 * (t.logpdf(0, 3) - t.logpdf(30 / (5 * np.sqrt(1.25)), 3))
    assert W[1, 0] == pytest.approx(by_hand)
    assert W[0, 1] == -W[1, 0]
    assert list(np.sign(least_odds(W))) == [-1, 1]


def test_a_larger_likelihood_decides_nothing_if_both_rivals_predict_it() -> None:
    # Flights of both rivals are likelier under the second by 50, and so is the recording.
    W = odds(np.array([0.0, 50.0]), likelihoods(50.0, 50.0, 5.0))
    assert W[1, 0] == pytest.approx(0.0)


def candidate(name: str, Z2: float, probe: int | None, scan: str = "") -> Any:
    named = SimpleNamespace(name=name, effect=SimpleNamespace(scan=scan))
    return SimpleNamespace(term=named, statistic=Z2, probe=probe)


def choice(*candidates: Any) -> Choice:
    return Choice(candidates[0].term, 100.0, 1.0, (), tuple(candidates))


def nulls(*mean: float) -> Any:
    return cast(Any, SimpleNamespace(mean=np.array(mean), inflation=1.0))


def test_a_large_bias_lets_the_comparison_decide() -> None:
    a, b, far = candidate("a", 70.0, 0), candidate("b", 60.0, 1), candidate("far", 5.0, 2)
    tried = candidate("tried", 90.0, None)
    compared = rivals(choice(a, b, far, tried), nulls(-10.0, 1.0, 0.0))
    assert [c.term.name for c in compared] == ["a", "b"]
    assert rivals(choice(a, b, far), nulls(-1.0, 1.0, 20.0)) == []
    assert rivals(choice(tried, a, b), nulls(-10.0, 1.0, 0.0)) == []


def test_a_tie_within_the_error_of_the_bias_correction_lets_the_comparison_decide() -> None:
    a, b = candidate("a", 70.0, 0), candidate("b", 60.0, 1)
    unbiased = nulls(-1.0, 1.0)
    assert rivals(choice(a, b), unbiased) == []
    assert rivals(replace(choice(a, b), within_bias_error=True), unbiased) == [a, b]


def test_the_mean_of_a_largest_score_is_no_bias() -> None:
    a, periodic = candidate("a", 70.0, 0), candidate("periodic", 60.0, 1, scan="frequency")
    assert rivals(choice(a, periodic), nulls(1.0, 3.7)) == []


def test_a_rival_that_cannot_be_simulated_is_not_the_cause(monkeypatch: pytest.MonkeyPatch) -> None:
    def fitted(name: str) -> CandidateFit:
        structure = SimpleNamespace(free=[SimpleNamespace(term=name)])
        optimum = SimpleNamespace(at=SimpleNamespace(row=np.arange(10)))
        problem: Any = SimpleNamespace(structure=structure)
        probe = ["a", "b"].index(name)
        return CandidateFit(candidate(name, 70.0, probe).term, problem, optimum, 90.0, 70.0, probe)

    def correct(problem: Any, *args: object, **keywords: object) -> Any:
        name = problem.structure.free[0].term
        return SimpleNamespace(
            is_corrected=name == "b", optimum=SimpleNamespace(at=SimpleNamespace(row=[]))
        )

    monkeypatch.setattr(module, "correct", correct)
    monkeypatch.setattr(module, "correction_starts", lambda optimum, current: [])
    monkeypatch.setattr(module, "likelihoods", lambda *a, **k: (np.zeros(1), np.zeros((1, 12, 1))))
    biased = SimpleNamespace(mean=np.array([-10.0, 1.0]), inflation=1.0, confidence=lambda Z2: 1.0)
    revised = compared_by_simulation(
        choice(fitted("a"), fitted("b")),
        cast(Any, None),
        cast(Any, biased),
        [],
        seed=0,
        flights_per_round=6,
    )
    assert revised.term.name == "b"
    assert revised.tied_with == ()


@pytest.mark.accuracy
def test_in_a_single_step_a_lag_is_named_or_confounded() -> None:
    device = "mock:?speed=max&seed=8400&hide=motor.lag:0.03"
    flight = flown(step_plan((10.0, None, None)), device=device, seed=8400)
    setup = Setup((flight,), 0, 6)
    made = screening_step(setup, fit_base(setup), 16).chosen(setup, None).choice
    assert made is not None
    assert "motor.lag" in {made.term.name, *made.tied_with}
