"""Backward elimination: blocks, cells and bootstrap intervals."""

from __future__ import annotations

import numpy as np
import pytest

from heli3dof.diagnosis.free_run import elimination as module
from heli3dof.diagnosis.free_run.elimination import (
    TermResult,
    bootstrap,
    known_beforehand,
    split_at_climb_end,
    with_confounded_terms,
    without_elimination,
)
from heli3dof.diagnosis.free_run.refits import (
    FOLD_BLOCK_S,
    STAGE_S,
    FitWithFolds,
    refit,
    split_windows,
)
from heli3dof.identification.greybox.freeflight import REAL_TERMS, problem_of
from heli3dof.identification.greybox.multistep import WINDOW_S, search
from heli3dof.identification.greybox.weak_form import weak_start
from heli3dof.model.greybox.prediction import Flight
from heli3dof.recording.recording import Recording
from tests.identification.known_flights import fly


def recorded() -> Recording:
    return fly(1022, until_s=40.0).recording.between(0, 25)


def flight(seconds: float, dt: float = 0.01) -> Flight:
    t = np.arange(0, seconds, dt)
    n = len(t)
    starts = np.arange(0, n - round(WINDOW_S / dt), 20)
    return Flight(
        t, np.full(n, dt), np.zeros((n, 2)), np.zeros((n, 3)), np.ones(3, bool), -np.inf, starts
    )


def test_training_and_test_windows_share_no_sample() -> None:
    f = flight(30.0)
    train, test = split_windows(f, 0)

    def rows(windows: np.ndarray) -> set[int]:
        n = round(WINDOW_S / f.dt)
        return {int(r) for k in f.starts[windows] for r in range(k, k + n)}

    assert train.any()
    assert test.any()
    assert not rows(train) & rows(test)
    assert {int(f.t[k] // FOLD_BLOCK_S) % 2 for k in f.starts[test]} == {0}


def test_a_term_is_kept_if_all_cells_agree_and_removed_if_they_disagree() -> None:
    assert bootstrap(np.array([1.0, 2.0, 1.5, 0.5, 1.2]), 1).significant
    mixed = bootstrap(np.array([3.0, -3.0, 2.0, -2.0, 0.1]), 1)
    assert not mixed.significant
    assert mixed.value == pytest.approx(0.02)
    assert mixed.low < 0 < mixed.high


def test_the_rotor_curve_is_known_in_advance_and_friction_is_not() -> None:
    known = known_beforehand(problem_of([recorded()], REAL_TERMS))
    assert "motor.rotor_curve" in known
    assert not any(k.startswith("friction") for k in known)


def test_the_filter_restarts_at_the_end_of_the_climb() -> None:
    recording = recorded()
    data = problem_of([recording], REAL_TERMS).data[0]
    lead, start, stop = data.blocks[0]
    split = split_at_climb_end(data, int(start) + 100)
    assert split.blocks[:2].tolist() == [[lead, start, start + 100], [lead, start + 100, stop]]
    assert len(split.free) == len(split.blocks)
    assert split_at_climb_end(data, int(start)).blocks.tolist() == data.blocks.tolist()


def test_blocks_decide_the_causes_and_the_model_keeps_all_terms(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The blocks do not need the yaw torque, but the model keeps it."""
    names = ("stiffness.pendulum.roll", "bias.torque.yaw", "motor.lag")
    problem = problem_of([recorded()], names)
    full = search(problem, weak_start(problem), stages_s=(STAGE_S,), rounds=1)
    intervals = {n: bootstrap(np.full(9, 1.0), 1) for n in names}
    intervals["bias.torque.yaw"] = bootstrap(np.linspace(-1, 1, 9), 1)
    monkeypatch.setattr(
        module,
        "without_term",
        lambda current, name, *, seed, instead=None: TermResult(name, intervals[name]),
    )
    result = module.eliminate(full)
    assert result.fit is full
    assert {r.term for r in result.needed} == {"stiffness.pendulum.roll", "motor.lag"}
    assert [r.term for r in result.removed] == ["bias.torque.yaw"]
    assert {t.name for t in result.first.fit.structure.terms} == set(names)
    assert len(result.halves) == 2


@pytest.mark.parametrize(("low", "tied"), [(-0.1, ("motor.delay",)), (0.1, ())])
def test_a_cause_is_confounded_with_what_replaces_it_without_loss(
    monkeypatch: pytest.MonkeyPatch, low: float, tied: tuple[str, ...]
) -> None:
    problem = problem_of([recorded()], ("motor.lag",))
    full = search(problem, weak_start(problem), stages_s=(STAGE_S,), rounds=1)
    increase = module.LossIncrease(0.1, low, 0.3, 0.1, 0.9)
    monkeypatch.setattr(module, "score_tests", lambda fit: [])
    monkeypatch.setattr(module, "possible_replacements", lambda *_: ["motor.delay"])
    monkeypatch.setattr(module, "without_term", lambda *_, **__: TermResult("", increase))
    with_folds = FitWithFolds(full, (full,))
    result = module.Elimination(full, (), (), with_folds, with_folds)
    (found,) = with_confounded_terms(result, [TermResult("motor.lag", increase)], seed=0)
    assert found.tied_with == tied


def test_a_refit_without_a_term_keeps_the_scale_and_reaches_the_optimum() -> None:
    problem = problem_of([recorded()], ("motor.lag", "bias.torque.yaw"))
    full = search(problem, weak_start(problem), stages_s=(STAGE_S,))
    less = refit(full, "bias.torque.yaw")
    assert (less.scale == full.scale).all()
    optimum = search(less.problem, less.z, full.noise, stages_s=(STAGE_S,), scale=full.scale)
    assert less.cost == pytest.approx(optimum.cost, abs=0.1)


def test_without_elimination_terms_are_kept_by_size_and_there_are_no_halves() -> None:
    problem = problem_of([recorded()], ("motor.lag", "bias.torque.yaw"))
    full = search(problem, weak_start(problem), stages_s=(STAGE_S,))
    result = without_elimination(full)
    assert [r.term for r in result.needed] == ["motor.lag"]
    assert [r.term for r in result.removed] == ["bias.torque.yaw"]
    assert result.halves == ()
