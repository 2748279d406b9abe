"""Doubtful findings: insignificant, of a commanded frequency, or of different sizes."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from heli3dof.diagnosis.conclusion.doubtful_findings import (
    confirmed,
    insignificant,
    is_in_motion,
    line_share,
    marked_if_doubtful,
    not_confirmed,
    size,
)
from heli3dof.diagnosis.result import Finding
from heli3dof.diagnosis.search.select import Choice
from heli3dof.diagnosis.validation.gain import Interval
from heli3dof.identification.closed_loop_fit.setup import Setup
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.method import fit_greybox
from heli3dof.model.effects import term
from heli3dof.recording.recording import Recording, recording_of_arrays
from heli3dof.rig.profile import default_profile
from tests.identification.known_flights import fly

PENDULUM, CABLE = "stiffness.pendulum.roll", "stiffness.cable.yaw"
T = np.arange(0, 60, 0.002)
SQUARE = np.where(np.floor(T / 5) % 2 == 0, 10.0, -10.0)


@pytest.mark.parametrize(("harmonic", "share"), [(1, 0.811), (3, 0.0901), (5, 0.0324)])
def test_a_square_waves_lines_hold_8_over_pi_squared_k_squared(harmonic: int, share: float) -> None:
    assert line_share(T, SQUARE, harmonic * 0.1) == pytest.approx(share, rel=0.01)


def test_the_share_is_zero_between_lines_and_for_a_constant_signal() -> None:
    assert line_share(T, SQUARE, 0.25) < 0.001
    assert line_share(T, np.full(len(T), 3.0), 0.1) == 0.0
    assert line_share(T, np.full(len(T), np.nan), 0.1) == 0.0


def test_without_a_logged_reference_the_angles_give_the_commanded_motion() -> None:
    t = np.arange(15_000) * 0.002
    r = recording_of_arrays(t, np.zeros((len(t), 2)), np.zeros((len(t), 3)), default_profile())
    swings = np.stack([0.0 * t, 0.2 * np.sin(2 * np.pi * 0.2 * t), 0.0 * t], axis=1)
    nothing = np.full_like(swings, np.nan)
    assert is_in_motion(replace(r, reference=nothing, angle=swings), 0.2)
    assert not is_in_motion(replace(r, reference=nothing, angle=swings), 1.3)
    assert is_in_motion(replace(r, reference=swings, angle=np.zeros_like(swings)), 0.2)
    assert not is_in_motion(replace(r, reference=np.zeros_like(swings), angle=swings), 0.2)


def without_controller(r: Recording) -> Recording:
    return replace(r, profile=r.profile.model_copy(update={"controller": None}))


def test_one_recording_is_enough_if_none_contradicts() -> None:
    assert confirmed([(2.2, 0.3), (1.0, 2.0)])
    assert not confirmed([(1.0, 0.8), (1.9, 1.4)])


def test_noise_confirms_no_cause_however_many_recordings_there_are() -> None:
    noise = np.random.default_rng(1).normal(size=(2000, 10))
    share = np.mean([confirmed([(d, 1.0) for d in flights]) for flights in noise])
    assert share < 0.06


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


def fit(value: float, std: float = 0.1) -> Estimate:
    """A fit of one term with one parameter, absent at zero."""
    free = SimpleNamespace(term="friction.viscous.yaw", null=0.0, log=False, slope=lambda v: 1.0)
    return cast(Any, SimpleNamespace(
        optimum=SimpleNamespace(theta=np.array([value])), values=np.array([value]), free=[free],
        std=np.array([std]),
        structure=SimpleNamespace(terms=[SimpleNamespace(name="friction.viscous.yaw")]),
    ))  # fmt: skip


def finding(name: str, low: float) -> Finding:
    """A finding; the interval of its gain on held-out data begins at ``low``."""
    choice = Choice(term(name), 30.0, 0.999, (), ())
    gain = SimpleNamespace(log_likelihood=Interval(28.0, low, 71.0))
    return Finding(choice, {}, cast(Any, gain), np.zeros(4))


def test_an_insignificant_gain_or_size_is_as_likely_as_not() -> None:
    findings = [
        finding("motor.delay", -8.0),
        finding("motor.delay", 3.0),
        finding("friction.viscous.yaw", 3.0),
    ]
    marked = marked_if_doubtful(findings, Setup((), 0, 6), fit(1.0, 0.6))
    assert [f.unconfirmed for f in marked] == [True, False, True]
    assert [f.choice.confidence for f in marked] == [0.5, 0.999, 0.5]


def test_a_size_compatible_with_zero_is_insignificant() -> None:
    assert insignificant(fit(1.0, 0.6)) == {"friction.viscous.yaw"}  # 1.7 standard deviations
    assert insignificant(fit(-1.0, 0.4)) == set()  # 2.5
