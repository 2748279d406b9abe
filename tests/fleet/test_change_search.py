"""Reported changes: false alarms, planted changes, and what must not be taken for a step."""

from __future__ import annotations

import numpy as np
import pytest

from heli3dof.fleet.change_search import Change, find_changes, normal_scores, track_prior
from tests.fleet.calibration import (
    RIGS,
    SERIES,
    TERMS,
    false_alarms,
    false_alarms_in_rooms,
    steps_found,
)

ONE_OF_TWENTY = track_prior(20)
N = 50
T = np.arange(float(N))


def noise(seed: int, n: int = N) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=n)


@pytest.mark.parametrize(
    ("flights", "scatter"),
    [
        (8, 0.0), pytest.param(8, 2.0, marks=pytest.mark.accuracy),
        *(pytest.param(n, s, marks=pytest.mark.accuracy) for n in (20, 50) for s in (0.0, 2.0)),
    ],
)  # fmt: skip
def test_at_most_one_rig_term_in_100_without_a_change_has_a_report(flights, scatter) -> None:
    """A rig with ten quantities; 100 rig-terms, so at most one report."""
    assert false_alarms(flights, scatter, seed=flights) <= 0.01 * TERMS


@pytest.mark.parametrize(
    ("spread", "odd"),
    [*(pytest.param(s, 1.0, marks=pytest.mark.accuracy) for s in (0.0, 0.3)), (0.0, 4.0)],
)
def test_the_siblings_scale_causes_no_false_alarms(spread, odd) -> None:
    """8 flights; ``odd``: one rig of each room scatters four times as much as its siblings."""
    assert false_alarms_in_rooms(8, spread, odd, seed=10) <= 0.01 * TERMS


def test_steps_in_few_flights_are_found_if_siblings_state_the_scatter() -> None:
    """6 standard deviations in 12 flights: alone it is a scatter of 3 as probably as a step."""
    alone, known = (steps_found(6, 11, flights=12, siblings=n) for n in (0, RIGS - 1))
    assert known >= 0.75 * SERIES > alone


def test_heavy_tails_without_standard_deviations_are_no_change() -> None:
    """Jitter is skewed: the search on normal scores makes no assumption on its distribution."""
    rng = np.random.default_rng(5)
    assert not any(
        find_changes(T, np.exp(2 * rng.normal(size=N)), None, ONE_OF_TWENTY) for _ in range(100)
    )


@pytest.mark.parametrize("size", [4, 6, 10])
def test_steps_are_dated_within_one_flight(size) -> None:
    """The step is between flights 5 and 45 of 50; at least 95 of 100 are found."""
    assert steps_found(size, seed=size) >= 0.95 * SERIES


def test_a_step_has_its_size_and_dates() -> None:
    y = noise(1) + 6 * (np.arange(N) >= 30)
    (step,) = find_changes(T, y, np.ones(N), ONE_OF_TWENTY)
    assert (step.kind, step.last, step.first) == ("step", 29, 30)
    assert step.size == pytest.approx(y[30:].mean() - y[:30].mean(), abs=0.02)
    assert step.interval[0] < 6 < step.interval[1]
    assert sum(step.dates.values()) >= 0.95
    assert step.probability > 0.99


@pytest.mark.parametrize("levels", [(0, 6, 0), (0, 6, 12), (0, 6, -6), (0, 6, 3)])
def test_two_steps_are_found_by_recursion(levels) -> None:
    found = 0
    for seed in range(20):
        y = noise(seed) + np.repeat(levels, (17, 17, 16))
        changes = find_changes(T, y, np.ones(N), ONE_OF_TWENTY)
        starts = [c.first for c in changes if c.kind == "step"]
        found += len(starts) == 2 and abs(starts[0] - 17) <= 1 and abs(starts[1] - 34) <= 1
    assert found >= 15


@pytest.mark.parametrize("flight", [0, 1, 20, 48, 49])
def test_one_deviating_flight_is_no_step(flight) -> None:
    y = noise(3)
    y[flight] += 15
    (found,) = find_changes(T, y, np.ones(N), ONE_OF_TWENTY)
    assert (found.kind, found.first, found.last) == ("deviating", flight, flight)


def test_a_step_is_found_under_two_deviating_flights() -> None:
    y = noise(4) + 6 * (np.arange(N) >= 25)
    y[[10, 40]] += 40, -40
    step, *deviating = find_changes(T, y, np.ones(N), ONE_OF_TWENTY)
    assert (step.kind, step.first) == ("step", 25)
    assert [c.first for c in deviating] == [10, 40]


def two_steps_in_plans(plans: int, seed: int) -> tuple[Change, ...]:
    """Changes found in 24 flights of so many plans, with steps of 8 and −8 at flights 10 and 17."""
    rng, flight = np.random.default_rng(seed), np.arange(24)
    plan = rng.integers(plans, size=24) if plans < 24 else flight
    y = rng.normal(size=24) + 30 * plan + 8 * ((flight >= 10) & (flight < 17))
    return find_changes(T[:24], y, np.ones(24), ONE_OF_TWENTY, plan)


def test_two_steps_are_found_in_flights_of_two_plans() -> None:
    found = [[c.first for c in two_steps_in_plans(2, seed)] for seed in range(10)]
    assert found.count([10, 17]) >= 7


def test_many_plans_in_few_flights_give_no_undefined_numbers() -> None:
    """With 24 plans in 24 flights, nothing can be compared."""
    changes = [c for seed in range(10) for c in two_steps_in_plans(6, seed)]
    assert np.isfinite([(c.size, *c.interval) for c in changes]).all()
    assert two_steps_in_plans(24, 0) == ()


def test_a_drift_is_no_step() -> None:
    y = noise(5) + np.linspace(0, 8, N)
    (drift,) = find_changes(T, y, np.ones(N), ONE_OF_TWENTY)
    assert (drift.kind, drift.first, drift.last) == ("drift", 0, N - 1)
    assert drift.interval[0] < 8 < drift.interval[1]


def test_scatter_beyond_the_stated_deviations_is_no_change() -> None:
    """Stated standard deviations of a tenth of the scatter."""
    assert not any(
        find_changes(T, noise(seed), np.full(N, 0.1), ONE_OF_TWENTY) for seed in range(50)
    )


def test_seven_flights_are_too_few() -> None:
    y = np.array([0.0, 0.01, 0.0, 5.0, 5.0, 5.01, 5.0])
    assert find_changes(T[:7], y, np.ones(7), ONE_OF_TWENTY) == ()


def test_a_step_without_standard_deviations_is_found() -> None:
    y = np.exp(noise(6)) * np.where(np.arange(N) >= 20, 30.0, 1.0)
    found = find_changes(T, y, None, ONE_OF_TWENTY)
    assert [(c.kind, c.first) for c in found] == [("step", 20)]


def test_normal_scores_of_three_values() -> None:
    """Quantiles of 1/6, 1/2 and 5/6; ties share the mean rank."""
    assert normal_scores(np.array([5.0, -1.0, 9.0])) == pytest.approx(
        [0, -0.9674, 0.9674], abs=1e-4
    )
    assert normal_scores(np.zeros(4)) == pytest.approx(np.zeros(4))
