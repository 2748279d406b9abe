"""Effects in real recordings that the fitted model does not explain, from a quick fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.diagnosis.conclusion.doubtful_findings import constant_voltage
from heli3dof.diagnosis.free_run.unexplained import (
    CreepRun,
    arm_torque,
    compare_runs,
    creep,
    measure_creep,
    pendulum_sentence,
    take_off,
)
from heli3dof.model.greybox.linearisation import equilibrium_deg, hover_voltage
from tests.diagnosis.rig_a import quick, recording


def test_the_arm_settles_where_its_hover_voltage_equals_the_voltage() -> None:
    recording("closed-1a")
    for angle in (-15.0, 0.0, 10.0):
        assert equilibrium_deg(quick(), hover_voltage(quick(), angle)) == pytest.approx(
            angle, abs=0.06
        )


def test_twice_the_torque_needs_two_to_the_one_over_n_times_the_voltage() -> None:
    recording("closed-1a")
    fit = quick()
    n = dict(zip(fit.structure.names, fit.values, strict=True))["motor.rotor_curve.exponent"]
    torque = arm_torque(fit, 10) / arm_torque(fit, -10)
    ratio = hover_voltage(fit, 10) / hover_voltage(fit, -10)  # of means of unequal motors
    assert ratio == pytest.approx(torque ** (1 / n), rel=5e-3)


def test_a_take_off_in_which_pitch_moves_against_the_thrusts_is_reported() -> None:
    """closed-1a: roll rises by 21.8° in 1.1 s; pitch falls, but the front motor has more thrust."""
    real, fit = recording("closed-1a"), quick()
    certain = replace(fit, tangents=1e3 * fit.tangents)  # very small standard deviations
    (note,) = take_off(certain, 0, real)
    assert note["roll_deg"]["measured"] == pytest.approx(21.8, abs=0.1)
    assert note["roll_deg"]["model_rotors_at_rest"] < note["roll_deg"]["model_rotors_at_speed"]
    p = note["pitch_acceleration_rad_per_s2"]
    assert p["measured"] < 0 < p["model"]
    assert p["model_std"] < 0.01
    assert "was not fitted" in note["sentence"]


def test_a_take_off_with_an_uncertain_model_is_not_reported() -> None:
    fit = quick()
    uncertain = replace(fit, tangents=1e-3 * fit.tangents)
    assert not list(take_off(uncertain, 0, recording("closed-1a")))


def test_creep_of_the_arm_under_constant_voltage_is_reported() -> None:
    run = measure_creep(quick(), recording("open-roll-5V-1"))
    assert run is not None
    (note,) = creep(run)
    assert note["early_deg"] == pytest.approx(-24.8, abs=0.2)
    assert note["late_deg"] == pytest.approx(-20.4, abs=0.2)
    assert note["thrust_late_over_early"] == pytest.approx(
        arm_torque(quick(), note["late_deg"]) / arm_torque(quick(), note["early_deg"])
    )
    assert "creeps" in note["sentence"]


def test_an_arm_at_the_predicted_angle_is_not_reported() -> None:
    run = recording("open-roll-5V-1")
    still = np.where(run.t[:, None] > 5, np.radians(equilibrium_deg(quick(), 5.0)), run.angle)
    still[run.t < 1] = np.radians(-40)  # the table, well below
    measured = measure_creep(quick(), replace(run, angle=still))
    assert measured is not None
    assert not list(creep(measured))


def test_a_closed_loop_flight_has_no_creep() -> None:
    assert measure_creep(quick(), recording("closed-1a")) is None


def run_of(voltage: float, factor: float, as_if: float) -> CreepRun:
    return CreepRun(f"open-{voltage:g}V", voltage, -20.0, -15.0, -20.0, factor, as_if, 90.0)


def test_runs_that_creep_by_the_same_voltage_are_reported() -> None:
    """The voltage grows by 0.9 V in both runs, the thrust by 36 % and 15 % (ratio above 2)."""
    (note,) = compare_runs([run_of(5, 1.36, 0.9), run_of(7, 1.15, 0.9)])
    assert note["one_size"] == {"thrust": False, "voltage": True}
    assert "One growth of voltage explains all of them" in note["sentence"]


def test_a_run_without_creep_contradicts_both_sizes() -> None:
    (note,) = compare_runs([run_of(5, 1.36, 0.9), run_of(9, 1.01, 0.05)])
    assert not any(note["one_size"].values())
    assert not list(compare_runs([run_of(5, 1.36, 0.9)]))


def test_only_an_open_loop_run_has_a_constant_voltage() -> None:
    assert constant_voltage(recording("closed-1a")) is None
    first, last = constant_voltage(recording("open-roll-5V-1")) or (0, 0)
    assert last - first > 90 / 0.005 * 0.9


@pytest.mark.parametrize(
    ("at_minus_10", "at_10", "word"), [(2.5, 4.9, "rises"), (4.9, 2.5, "falls")]
)
def test_the_hover_voltage_changes_in_the_measured_direction(
    at_minus_10: float, at_10: float, word: str
) -> None:
    (sentence,) = pendulum_sentence(at_minus_10, at_10, at_minus_10, at_10)
    assert f"The hover voltage {word} with roll" in sentence
    assert "unlike" not in sentence


def test_a_model_that_changes_in_the_other_direction_explains_nothing() -> None:
    assert pendulum_sentence(4.9, 2.5, 2.5, 4.9) == []
