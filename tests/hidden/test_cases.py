"""What is hidden in the cases, and what the diagnosis gets of it."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from heli3dof.model.effects import all_names
from heli3dof.recording.recording import Recording
from heli3dof.rig.drivers import open_driver
from heli3dof.rig.profile import default_profile
from tests.drivers.test_hide import CONTRACT
from tests.hidden.cases import CLASSES, Case, Hidden, blind, draw, fly, plan_named, truth_of
from tests.hidden.equivalences import equals
from tests.hidden.sizes import EFFECTS, OUTSIDE, SIZES

IN_FLIGHT = slice(0, 14_500)
STEP = np.radians(360 / 4096)
L_A, T_G = 0.6604, 1.170
"""m, N·m (2 L_a K_f V_o) of the default profile"""


def test_at_least_three_flights_in_ten_hide_nothing() -> None:
    total = sum(c.count for c in CLASSES.values())
    assert total >= 300
    assert sum(c.count for c in CLASSES.values() if not c.effects) >= 0.3 * total


def test_a_class_of_single_effects_has_each_effect_equally_often() -> None:
    drawn = Counter(draw("rich-large", seed).hidden[0].name for seed in range(90))
    assert set(drawn) == set(EFFECTS)
    assert set(drawn.values()) == {2}


def test_equal_seeds_draw_equal_cases_and_different_seeds_different_ones() -> None:
    assert draw("rich-pair", 1003) == draw("rich-pair", 1003)
    assert draw("rich-pair", 1003) != draw("rich-pair", 1004)


def test_the_table_lists_every_effect_of_the_contract_and_only_effects_of_the_emulated_rig() -> (
    None
):
    """A new effect needs no row: rows are drawn by seed, so another row changes every case."""
    from heli3dof_drivers.emulator.effects import catalogue

    has = {
        f"{e.name}.{a}" if a else e.name: e for e in catalogue().values() for a in e.axes or ("",)
    }
    assert set(EFFECTS) == {name for name, effect in has.items() if effect.name in CONTRACT}
    assert set(OUTSIDE) <= set(has) - set(EFFECTS)


def test_no_effect_from_outside_the_catalogue_is_in_the_models() -> None:
    assert not set(OUTSIDE) & set(all_names())


@pytest.mark.parametrize("effect", EFFECTS.values(), ids=lambda e: e.name)
def test_larger_sizes_are_further_from_no_effect(effect) -> None:
    away = [abs(v - effect.null) for v in effect.sizes]
    assert sorted(away) == away
    assert len(set(away)) == len(SIZES)


def test_the_diagnosis_gets_no_information_about_the_hidden_effect() -> None:
    case = Case("run-step-single", 1000, (Hidden("friction.coulomb.yaw", "large", (0.05,)),), 1000)
    flight = fly(case)
    seen = blind(flight.recording)
    assert "friction" in str(flight.recording.meta)
    for leak in ("friction", "hide", "mock", str(case.rig_seed), "spread"):
        assert leak not in f"{seen.meta} {seen.profile} {sorted(seen.channels)}", leak
    assert seen.profile == default_profile().with_controller()
    assert np.array_equal(seen.angle, flight.recording.angle)


def test_true_sizes_are_in_si_units() -> None:
    """0.05 N·m are 0.05 N·m, and a gain of 1.5 on a K_f 3 % above the profile's is 1.545."""
    hidden = (
        Hidden("friction.coulomb.yaw", "large", (0.05,)),
        Hidden("motor.thrust_gain", "large", (1.5,)),
    )
    case = Case("rich-large", 1000, hidden, 1005)
    profile = default_profile()
    body = open_driver(case.device, profile).truth.body  # type: ignore[attr-defined]
    recording = fly(Case("run-step-nothing", 1000, (), 1005)).recording
    truth = truth_of(case, recording)
    ratio = body.K_f / profile.motor.K_f
    assert truth.values["friction.coulomb.yaw"]["torque_Nm"] == 0.05
    assert truth.values["motor.thrust_gain"]["gain"] == pytest.approx(1.5 * ratio)
    assert abs(ratio - 1) > 0.001


def test_an_unreached_voltage_limit_and_yaw_s_zero_are_not_expected_findings() -> None:
    recording = fly(Case("run-step-nothing", 1000, (), 1005)).recording
    highest = float(np.abs(recording.voltage).max())
    for hidden, seen in (
        (Hidden("motor.saturation", "small", (highest + 0.1,)), False),
        (Hidden("motor.saturation", "small", (highest - 0.5,)), True),
        (Hidden("encoder.offset.yaw", "large", (15.0,)), False),
    ):
        truth = truth_of(Case("run-step-single", 1000, (hidden,), 1005), recording)
        assert truth.names == ((hidden.name,) if seen else ())
        assert truth.unseen == (() if seen else (hidden.name,))


def test_an_effect_is_its_own_equal() -> None:
    assert equals("motor.lag") == {"motor.lag"}
    assert equals("aero.reaction_torque") == equals("encoder.offset.pitch")


@pytest.mark.accuracy
def test_a_pitch_offset_flies_as_a_reaction_torque() -> None:
    """`equivalences` 2, on the emulated rig without noise: δ = 2°, κ = L_a sin δ = 0.023 m. The
    readings differ by quantisation only, less than a step; the effect is 23 steps."""
    kappa = L_A * np.sin(np.radians(2.0))
    bare, first, second = (
        flown(h) for h in ("", "encoder.offset.pitch:2", f"aero.reaction_torque:{kappa:.6f}")
    )
    assert (rms(first.angle - bare.angle) > 20 * STEP).any()
    assert (rms(first.angle - second.angle) < STEP).all()


@pytest.mark.accuracy
def test_a_roll_offset_flies_as_a_pendulum_on_another_weight() -> None:
    """`equivalences` 3: δ = 6°, k = T_g sin δ = 0.122 N·m in addition to T_g cos δ. At 10° of
    roll the pendulum takes k sin r / (2 L_a K_f cos p) = 0.135 V more from each motor,
    less the saving on T_g (1 − cos δ) cos r = 0.040 V."""
    delta = np.radians(6.0)
    equal = f"stiffness.pendulum.roll:{T_G * np.sin(delta):.6f}"
    equal += f",mass.imbalance:{-T_G * (1 - np.cos(delta)):.6f}"
    bare, first, second = (
        flown(h).voltage[-2500:].mean() for h in ("", "encoder.offset.roll:6", equal)
    )
    assert first - bare == pytest.approx(0.135 - 0.040, abs=0.005)
    assert first - second == pytest.approx(0.0, abs=0.005)


def rms(x: np.ndarray) -> np.ndarray:
    return np.asarray(np.sqrt((x**2).mean(axis=0)))


def flown(hide: str) -> Recording:
    """The CLI's default flight, from level to before the landing."""
    from heli3dof.experiment.fly import fly_plan

    device = f"mock:?speed=max&noise=0&start=level&seed=1&hide={hide}"
    return fly_plan(plan_named("run-step"), device=device, seed=1).recording.rows(IN_FLIGHT)
