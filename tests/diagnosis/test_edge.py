"""A rig on the tolerance's edge is refuted by flights of another, and by none of its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.diagnosis.corrected import Corrected, correct, fly_again, model_at
from heli3dof.diagnosis.edge import Pinned, efficient, multiplier, on_the_edge, refuted
from heli3dof.diagnosis.steps import Bench, base_of
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import load_plan

PITCH = 2


@pytest.fixture(scope="module")
def fitted() -> tuple[Bench, Corrected]:
    device = "mock:?speed=max&seed=1022"
    flown = fly_plan(load_plan("rich"), device=device, seed=1022).recording.between(6.0, 22.0)
    bench = Bench((flown,), seed=0, pilots=4)
    return bench, base_of(bench)


def test_a_rig_15_percent_off_is_refuted_and_one_that_is_not_off_is_not(
    fitted: tuple[Bench, Corrected],
) -> None:
    bench, found = fitted
    at, off = found.values[PITCH], 1.15 * found.values[PITCH]
    assert refuted(bench, found, PITCH, off)
    # A step of a hundredth of a standard deviation, so that there is a side to be on.
    assert not refuted(bench, found, PITCH, at + 0.01 * found.std[PITCH])


def test_the_multiplier_counts_the_standard_deviations_to_the_estimate(
    fitted: tuple[Bench, Corrected],
) -> None:
    bench, found = fitted
    sd = found.std[PITCH] / found.values[PITCH]
    there = on_the_edge(bench, found, PITCH, found.values[PITCH] * np.exp(6 * sd), 1.0)
    assert there.theta[PITCH] == pytest.approx(found.theta[PITCH] + 6 * sd, abs=0.01 * sd)
    # The flights' own scatter is within a factor of two of the noise model's.
    assert 3 < multiplier(bench, found, there, PITCH) < 12


def test_a_rig_whose_flights_chatter_otherwise_is_no_ground_to_refute_another(
    fitted: tuple[Bench, Corrected],
) -> None:
    bench, found = fitted
    problem, o = found.problem, found.optimum
    loud = np.array(o.noise)
    loud[1] *= 30
    model = model_at(problem, o.theta, loud)
    shaken = replace(
        found, problem=replace(problem, data=fly_again(model, bench.recordings, problem.data, [1]))
    )
    assert not refuted(bench, shaken, PITCH, 1.15 * found.values[PITCH])


def test_what_the_others_explain_is_not_the_parameter_s() -> None:
    H = np.array([[4.0, 2.0], [2.0, 4.0]])
    # Score (2, 4) is that of a step of 1 in the other alone.
    assert efficient(np.array([[2.0, 4.0]]), H, np.zeros(2), 0) == pytest.approx(0.0)
    # Of a step of 1 in this: 4 − 2 · 2/4 = 3 is left.
    assert efficient(np.array([[4.0, 2.0]]), H, np.zeros(2), 0) == pytest.approx(3.0)


def test_a_pinned_coordinate_stays_where_it_is(fitted: tuple[Bench, Corrected]) -> None:
    bench, found = fitted
    pinned = Pinned(found.problem.data, found.structure, which=1, at=0.3)
    assert pinned.prior_mean[1] == 0.3
    assert pinned.prior_precision[1] == 1e8
    assert pinned.prior_precision[2] == found.problem.prior_precision[2]
    start = found.theta.copy()
    start[1] = 0.3
    there = correct(
        pinned, start, found.optimum.noise, bench.recordings, seed=0, pilots=2, rounds=2
    )
    assert there.theta[1] == pytest.approx(0.3, abs=1e-5)
