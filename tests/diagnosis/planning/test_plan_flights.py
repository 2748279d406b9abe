"""The fast simulation of a plan equals the slow one, noise included; none outside the envelope."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.diagnosis.planning.plan_flights import (
    inside_envelope,
    is_stable,
    rendered_plan,
    simulated_plan,
)
from heli3dof.experiment.plan import load_plan, step_plan
from heli3dof.experiment.simulate import simulate
from heli3dof.identification.bias_correction.simulated_flight import simulated_flight
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.rig.profile import default_profile

PROFILE = default_profile()


def world(scale: float = 1.0) -> GreyBoxModel:
    """The profile's rig, its thrust gain (the first value) ``scale`` times as large."""
    structure = Structure(PROFILE, ())
    values = structure.values_of({}) * np.array([scale] + [1.0] * (len(structure.free) - 1))
    n = len(values)
    return GreyBoxModel(
        "world", PROFILE, (), values, np.array([0.03, 0.1, 0.015]), np.full((n, n), np.nan)
    )


@pytest.mark.parametrize("name", ["doublets", "ring-down"])
def test_the_fast_simulation_equals_the_simulated_recording(name: str) -> None:
    plan = rendered_plan(load_plan(name), PROFILE, 1270)
    assert plan is not None
    assert (plan.signals.opened is not None) == (name == "ring-down")
    fast = simulated_plan(plan, world())
    slow = simulated_flight(
        world(),
        simulate(load_plan(name), world(), profile=PROFILE, seed=1270),
        np.random.default_rng([1270, 5]),
    )
    assert fast is not None
    assert np.array_equal(fast.angle, slow.angle)
    assert np.array_equal(fast.voltage, slow.voltage)


def test_a_plan_outside_the_envelope_is_not_rendered() -> None:
    low = PROFILE.limits.roll_max_deg
    assert rendered_plan(step_plan((low - 1, None, None)), PROFILE, 0) is not None
    assert rendered_plan(step_plan((low + 1, None, None)), PROFILE, 0) is None


def test_a_flight_that_leaves_the_envelope_is_none() -> None:
    tight = PROFILE.model_copy(
        update={"limits": PROFILE.limits.model_copy(update={"roll_max_deg": 11.0})}
    )
    plan = rendered_plan(step_plan((10.5, None, None), settle_s=5.0, duration_s=5.0), tight, 0)
    assert plan is not None
    assert simulated_plan(plan, world()) is None  # it overshoots by more than half a degree


def test_one_row_outside_the_envelope_is_detected() -> None:
    plan = rendered_plan(step_plan((5.0, None, None), settle_s=1.0, duration_s=1.0), PROFILE, 0)
    assert plan is not None
    flight = simulated_plan(plan, world())
    assert flight is not None
    angle = flight.angle.copy()
    angle[77, 1] = np.deg2rad(PROFILE.limits.pitch_max_deg + 0.1)
    assert not inside_envelope(replace(flight, angle=angle))
    angle[77, 1] = np.nan
    assert not inside_envelope(replace(flight, angle=angle))


def test_a_rig_with_reversed_motors_is_not_stabilised() -> None:
    controller = PROFILE.with_controller().controller
    assert controller is not None
    wrong = PROFILE.model_copy(
        update={
            "controller": controller.model_copy(
                update={"K": tuple(tuple(-k for k in row) for row in controller.K)}
            )
        }
    )
    assert is_stable(world())
    assert not is_stable(replace(world(), profile=wrong))
