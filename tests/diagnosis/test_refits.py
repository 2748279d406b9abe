"""The estimator, run on flights of a rig whose inertia is known, finds that inertia."""

from __future__ import annotations

import numpy as np

from heli3dof.diagnosis.refits import Pinned, refits
from heli3dof.diagnosis.steps import Bench, base_of
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import load_plan


def test_flights_of_a_known_rig_are_estimated_about_it() -> None:
    device = "mock:?speed=max&seed=1022"
    flown = fly_plan(load_plan("rich"), device=device, seed=1022).recording.between(6.0, 22.0)
    bench = Bench((flown,), seed=0, pilots=4)
    found = base_of(bench)
    nominal = found.free[2].start
    delta = refits(bench, found, 2, 1.15 * nominal, flights=3)
    assert len(delta) == 3
    # Of J_pitch a rich flight tells a per cent; the recording itself says 15 % less.
    assert np.abs(delta).max() < 0.05
    assert found.values[2] / nominal < 1.1


def test_a_pinned_coordinate_stays_where_it_is() -> None:
    device = "mock:?speed=max&seed=1022"
    flown = fly_plan(load_plan("rich"), device=device, seed=1022).recording.between(6.0, 10.0)
    found = base_of(Bench((flown,), seed=0, pilots=2))
    pinned = Pinned(found.problem.data, found.structure, which=1, at=0.3)
    assert pinned.prior_mean[1] == 0.3
    assert pinned.prior_precision[1] == 1e8
    assert pinned.prior_precision[2] == found.problem.prior_precision[2]
