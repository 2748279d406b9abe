"""Two causes whose ranking changes between segments of the flight are confounded."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import pytest

from heli3dof.diagnosis.conclusion import doubtful_findings as module
from heli3dof.diagnosis.conclusion.doubtful_findings import (
    log_likelihood_cells,
    ranking_probability,
    ranking_std,
    tied_by_segments,
)
from heli3dof.diagnosis.search.candidate_fits import CandidateFit
from heli3dof.diagnosis.search.select import Choice
from heli3dof.identification.closed_loop_fit.base_fit import fit_base
from heli3dof.identification.closed_loop_fit.setup import Setup
from heli3dof.model.effects import term, terms
from tests.flown import flown

NAMES = ("motor.supply_sag", "motor.thrust_curve", "motor.saturation")
NONE = cast(Any, None)
C = 100


def choice_of(*scores: float, tied: tuple[str, ...] = ()) -> Choice:
    fits = tuple(
        CandidateFit(t, NONE, NONE, s, 50.0, i)
        for i, (t, s) in enumerate(zip(terms(NAMES), scores, strict=False))
    )
    return Choice(fits[0].term, scores[0], 1.0, tied, fits)


@pytest.fixture
def apart(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cells with differences of ± 1: s = 20 for a hundred."""
    monkeypatch.setattr(
        module,
        "log_likelihood_cells",
        lambda c: np.tile([1.0, -1.0], C // 2) * (c.term.name == NAMES[0]),
    )


@pytest.mark.parametrize(("second", "tied"), [(88.0, (NAMES[1],)), (86.0, ())])
def test_causes_ranked_with_less_than_95_percent_are_confounded(
    apart: None, second: float, tied: tuple[str, ...]
) -> None:
    result = tied_by_segments(choice_of(120.0 - 0.01, second), set())
    assert result.tied_with == tied
    # The confidence is that of the cause or of one confounded with it.
    expected = 1.0 if tied else ranking_probability(120.0 - 0.01 - second, 20.0)
    assert result.confidence == pytest.approx(expected)


def test_an_adopted_cause_is_not_an_alternative(apart: None) -> None:
    assert tied_by_segments(choice_of(120.0, 118.0), {NAMES[1]}).tied_with == ()


def test_a_confounded_cause_is_listed_once(apart: None) -> None:
    assert tied_by_segments(choice_of(120.0, 118.0, tied=NAMES[1:2]), set()).tied_with == NAMES[1:2]


def test_a_far_less_likely_cause_is_not_evaluated(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "log_likelihood_cells", lambda c: pytest.fail(c.term.name))
    assert tied_by_segments(choice_of(120.0, 59.0), set()).confidence == 1.0


def test_segments_that_agree_rank_with_certainty() -> None:
    assert ranking_std(np.full(C, 0.3)) == pytest.approx(0.0, abs=1e-9)
    assert ranking_probability(5.0, 0.0) == 1.0


def test_the_cells_add_up_to_the_whole_likelihood() -> None:
    recording = flown("rich", 14.0, device="mock:?speed=max&seed=1209", seed=1)
    base = fit_base(Setup((recording,), 1, 4))
    one = CandidateFit(term(NAMES[0]), base.problem, base.optimum, 0.0, 0.0, None)
    by_cell = log_likelihood_cells(one)
    assert by_cell.sum() == pytest.approx(float(base.optimum.at.loglik.sum()), rel=1e-9)
    assert len(by_cell) == -(-len(base.problem.data.t) // 1000)  # 2 s at 500 Hz
