"""Causes confounded with a wrong base parameter."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from heli3dof.diagnosis.base_parameters import OffNominal, off_nominal
from heli3dof.diagnosis.conclusion import confounded_parameters
from heli3dof.diagnosis.conclusion.confounded_parameters import (
    confounded_causes,
    instead_of_inertia,
    last_step_with_causes,
    separable_by_flight,
    with_confounded_causes,
    with_thrust_gain_ties,
)
from heli3dof.diagnosis.search.steps import Step, screening_step
from heli3dof.experiment.plan import step_plan
from heli3dof.identification.closed_loop_fit.base_fit import fit_base
from heli3dof.identification.closed_loop_fit.setup import Setup
from heli3dof.model.effects import term
from heli3dof.rig.profile import default_profile
from tests.flown import flown

SLOW = "disturbance.periodic.roll:0.12@0.366"
HEAVY = "inertia.roll:1.6"


def step(absorbed: float, v: float, Z: float, ratio: float = 1.4) -> Any:
    """A score evaluation with one probe of the thrust curve's typical size. The base absorbs it by
    ``absorbed`` in ln J_roll; its information is v, and the recording shows Z."""
    curve = term("motor.thrust_curve")
    values = np.array([1.0, ratio, 1.0, 1.0])
    free = [SimpleNamespace(start=1.0, unit="kg·m²", scaled=np.log)] * 4
    probe = SimpleNamespace(
        term=curve, name=curve.name, grows=True, size=curve.effect.parameters[0].typical,
        values=(0.0,),
    )  # fmt: skip
    fit = SimpleNamespace(
        free=free, values=values, std=0.001 * values,
        structure=SimpleNamespace(profile=default_profile(), free=free),
    )  # fmt: skip
    screen = SimpleNamespace(
        plain=(probe,), solved=np.array([[0.0], [absorbed], [0.0], [0.0]]), v=np.array([v])
    )
    nulls = SimpleNamespace(std=np.ones(1))
    Zs = np.array([Z])
    return cast(Any, SimpleNamespace(fit=fit, screen=screen, nulls=nulls, Z=Zs))


def test_an_effect_that_absorbs_the_inertia_without_a_trace_is_confounded_with_it() -> None:
    # ln 1.4 − ln 1.15 ≈ 0.2 (K_f absorbs a little), a tenth for each typical size: two of them.
    assert confounded_causes(step(0.1, v=0.01, Z=0.0), 1) == ("motor.thrust_curve",)


@pytest.mark.parametrize(("absorbed", "v", "Z"), [(0.001, 0.01, 0.0), (0.1, 100.0, 0.0)])
def test_an_effect_that_must_be_huge_or_would_be_visible_is_not_confounded(
    absorbed: float, v: float, Z: float
) -> None:
    assert confounded_causes(step(absorbed, v, Z), 1) == ()


def test_an_effect_visible_at_the_required_size_is_confounded() -> None:
    # Two typical sizes at √v = 10 show Z = 20.
    shown = (np.log(1.4) - np.log(1.15)) / 0.1 * 10
    assert confounded_causes(step(0.1, v=100.0, Z=float(shown)), 1) == ("motor.thrust_curve",)


def test_a_larger_visible_effect_is_confounded_up_to_the_lower_tolerance() -> None:
    # ln 1.4 − ln 0.85 ≈ 0.5, five typical sizes at √v = 10: they show Z = 50.
    assert confounded_causes(step(0.1, v=100.0, Z=45.0), 1) == ("motor.thrust_curve",)
    assert confounded_causes(step(0.1, v=100.0, Z=60.0), 1) == ()
    assert confounded_causes(step(0.1, v=100.0, Z=-20.0), 1) == ()


def scaled_base(share: float, v: float, Z: float) -> Any:
    """A score evaluation at a base with four parameters 1.6 times nominal, so that K_f is low by
    as much. The probe, a dead zone of 1 V, lowers the logarithm of each by ``share``."""
    dead = term("motor.dead_zone")
    values = np.full(4, 1.6)
    free = [SimpleNamespace(start=1.0, unit="N·m", scaled=np.log, unscaled=np.exp)] * 4
    probe = SimpleNamespace(term=dead, name=dead.name, grows=True, size=1.0, values=(1.0,))
    fit = SimpleNamespace(
        free=free, values=values, std=0.001 * values,
        structure=SimpleNamespace(profile=default_profile(), terms=(), free=free),
    )  # fmt: skip
    screen = SimpleNamespace(plain=(probe,), solved=np.full((4, 1), share), v=np.array([v]))
    nulls = SimpleNamespace(std=np.ones(1))
    return cast(Any, SimpleNamespace(fit=fit, screen=screen, nulls=nulls, Z=np.array([Z])))


LOW = OffNominal(term("motor.thrust_gain"), 1 / 1.6, 0.03, 200.0, 1.0)


def test_a_thrust_gain_is_confounded_with_an_effect_that_scales_the_whole_base() -> None:
    # ln 1.6 − ln(1/0.85) = 0.31 to explain: at 0.25 for each volt 1.23 V, and √v = 6 shows Z = 7.4.
    (low,) = with_confounded_causes([LOW], scaled_base(0.25, 36.0, 7.4))
    assert low.tied_with == ("motor.dead_zone",)


@pytest.mark.parametrize(
    ("share", "v", "Z"),
    [
        (0.25, 36.0, 0.0),  # it is absent
        (0.25, 36.0, 20.0),  # it is larger, in addition to a wrong K_f
        (0.01, 0.01, 0.0),  # it would have to be huge
        (-0.25, 0.01, 0.0),  # a negative size would be needed
    ],
)
def test_otherwise_a_thrust_gain_is_not_confounded(share: float, v: float, Z: float) -> None:
    (low,) = with_confounded_causes([LOW], scaled_base(share, v, Z))
    assert low.tied_with == ()


def test_an_inertia_is_confounded_with_other_effects(monkeypatch: pytest.MonkeyPatch) -> None:
    drag = SimpleNamespace(term=term("drag.quadratic.roll"))
    monkeypatch.setattr(confounded_parameters, "instead_of_inertia", lambda step: [drag])
    off = OffNominal(term("inertia.roll"), 1.4, 0.03, 200.0, 1.0)
    (roll,) = with_confounded_causes([off], step(0.1, 0.01, 0.0))
    assert roll.tied_with == ("motor.thrust_curve", "drag.quadratic.roll")


def test_the_last_step_with_the_same_causes_is_used() -> None:
    def step_with(*names: str) -> Any:
        terms = tuple(term(n) for n in names)
        return SimpleNamespace(fit=SimpleNamespace(structure=SimpleNamespace(terms=terms)))

    steps = [step_with(), step_with("motor.lag"), step_with("motor.lag", "motor.dead_zone")]
    assert last_step_with_causes(steps, step_with("motor.lag").fit) is steps[1]
    assert last_step_with_causes(steps, step_with("motor.delay").fit) is steps[2]


@cache
def first_step(hide: str, seed: int) -> tuple[Setup, Step]:
    """Return the screen of a 10° step in roll."""
    device = f"mock:?speed=max&seed={seed}&hide={hide}"
    flight = flown(step_plan((10.0, None, None)), device=device, seed=seed)
    setup = Setup((flight,), seed, 6)
    return setup, screening_step(setup, fit_base(setup), 16)


@pytest.mark.accuracy
@pytest.mark.parametrize("hide", [SLOW, HEAVY])
def test_a_slow_torque_and_a_wrong_inertia_both_move_the_roll_inertia(hide: str) -> None:
    _, step = first_step(hide, 1202)
    off = off_nominal(step.fit)
    assert [o.term.name for o in off] == ["inertia.roll"]


def test_no_effect_restores_an_inertia_that_is_truly_off() -> None:
    _, step = first_step(HEAVY, 1202)
    assert instead_of_inertia(step) == []


@pytest.mark.accuracy
def test_a_slow_torque_is_confounded_with_the_inertia_that_absorbed_it() -> None:
    _, step = first_step(SLOW, 1202)
    assert step.largest[0][1] < step.nulls.threshold
    best = instead_of_inertia(step)[0]
    torque, frequency = best.problem.values(best.optimum.theta)[-3:-1]
    assert torque == pytest.approx(0.12, abs=0.012)
    assert frequency == pytest.approx(0.366, abs=0.003)
    (off,) = off_nominal(step.fit)
    (tied,) = with_confounded_causes([off], step)
    assert "disturbance.periodic.roll" in tied.tied_with


def off(name: str, ratio: float) -> OffNominal:
    return OffNominal(term(name), ratio, 0.02, 100.0, 1.0)


def test_no_plan_is_proposed_for_causes_that_no_flight_separates() -> None:
    assert separable_by_flight("inertia.yaw", ("motor.delay", "encoder.scale.yaw")) == (
        "motor.delay",
    )


def test_no_flight_separates_the_thrust_gain_from_the_inertias() -> None:
    found = with_thrust_gain_ties([off("motor.thrust_gain", 1.4), off("mass.imbalance", 0.4)])
    assert found[0].tied_with == ("inertia.roll", "inertia.pitch", "inertia.yaw")
    assert found[1].tied_with == ("motor.thrust_gain",)
    assert separable_by_flight("motor.thrust_gain", found[0].tied_with) == ()


def test_without_a_wrong_thrust_gain_a_weight_is_a_finding_of_its_own() -> None:
    (found,) = with_thrust_gain_ties([off("mass.imbalance", 0.4)])
    assert found.tied_with == ()
