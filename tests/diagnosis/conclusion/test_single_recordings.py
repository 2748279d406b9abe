"""Causes that single recordings confirm, and causes that only a comparison shows."""

from __future__ import annotations

from dataclasses import replace

from heli3dof.diagnosis.conclusion.single_recordings import confirmed, not_confirmed, size
from heli3dof.identification.greybox.method import fit_greybox
from heli3dof.recording.recording import Recording
from tests.identification.known_flights import fly

PENDULUM, CABLE = "stiffness.pendulum.roll", "stiffness.cable.yaw"


def without_controller(r: Recording) -> Recording:
    return replace(r, profile=r.profile.model_copy(update={"controller": None}))


def test_one_recording_is_enough_if_none_contradicts() -> None:
    assert confirmed([(2.2, 0.3), (1.0, 2.0)])
    assert not confirmed([(1.0, 0.8), (1.9, 1.4)])


def test_two_different_sizes_are_not_one_cause() -> None:
    """2.83 and 3.2 standard deviations (√2 · 0.3) apart; the limit is 3."""
    assert confirmed([(2.2, 0.3), (1.0, 0.3)])
    assert not confirmed([(2.4, 0.3), (1.04, 0.3)])


def test_a_single_recording_has_no_comparison_and_one_time_events_are_skipped() -> None:
    r = without_controller(fly(1022, until_s=40.0).recording.between(0, 10))
    assert not_confirmed([PENDULUM], [r]) == set()
    assert not_confirmed(["mass.change"], [r, r]) == set()


def test_recordings_confirm_a_present_cause_and_not_an_absent_one() -> None:
    r = without_controller(fly(1022, until_s=40.0).recording)
    parts = [r.between(0, 20), r.between(20, 40)]
    assert not_confirmed([PENDULUM, CABLE], parts) == {CABLE}


def test_the_size_and_its_deviation_come_from_the_fit() -> None:
    fit = fit_greybox(fly(1022, until_s=40.0).recording.between(0, 20), [PENDULUM])
    value, std = size(fit, PENDULUM)
    assert std > 0
    assert value == fit.values[fit.structure.names.index(f"{PENDULUM}.torque_Nm")]


def test_recordings_that_cannot_be_fitted_are_ignored() -> None:
    r = without_controller(fly(1022, until_s=40.0).recording)
    assert not_confirmed([PENDULUM], [r.between(0, 20), r.between(20, 20.1)]) == set()
