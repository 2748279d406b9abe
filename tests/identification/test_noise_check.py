"""The noise check accepts mock flights and rejects a vibrating real rig."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import heli3dof as h3
from heli3dof.identification.greybox.multistep import search
from heli3dof.identification.greybox.noise_check import (
    CLOCK,
    NoiseCheck,
    likelihood_obstacle,
    noise_check,
)
from heli3dof.recording.recording import Recording
from tests.identification.known_flights import fly
from tests.paths import REAL_DATA


def without_loop(recording: Recording) -> Recording:
    profile = recording.profile.model_copy(update={"controller": None})
    return replace(recording, profile=profile)


@pytest.fixture(scope="module")
def rig_b() -> Recording:
    folder = REAL_DATA / "rig-b"
    if not folder.is_dir():
        pytest.skip("the real recordings are not here")
    return h3.load(folder / "closed-08.csv", h3.load_profile(folder / "profile.toml"))


def test_white_noise_of_0_1_predicts_3_3_degrees_after_a_second() -> None:
    """0.1 rad/s²/√Hz · √(1/3 s³) = 0.0577 rad"""
    check = NoiseCheck(np.full(3, 0.1), np.full(3, 5.0))
    assert check.expected_deg == pytest.approx(np.full(3, 3.308), abs=0.001)


def test_the_check_fails_only_on_large_noise_with_small_prediction_errors() -> None:
    loud, usual = np.array([0.05, 2.0, 0.05]), np.array([0.05, 0.15, 0.05])
    assert not NoiseCheck(loud, np.full(3, 10.0)).usable
    assert NoiseCheck(loud, np.full(3, 60.0)).usable
    assert NoiseCheck(usual, np.full(3, 0.1)).usable


@pytest.mark.accuracy
@pytest.mark.parametrize("hide", ["", "encoder.backlash.pitch:0.5", "motor.lag:0.1"])
def test_mock_flights_pass_the_check(hide: str) -> None:
    assert likelihood_obstacle([without_loop(fly(1310, "rich", hide=hide).recording)]) == ""


def test_a_vibrating_rig_fails_the_check_with_a_reason(rig_b: Recording) -> None:
    check = noise_check([rig_b])
    assert check is not None
    assert check.overstated.tolist() == [False, True, False]
    reason = likelihood_obstacle([rig_b])
    assert "on pitch" in reason
    assert reason != CLOCK


def test_a_second_of_flight_is_too_short_for_the_check(rig_b: Recording) -> None:
    assert noise_check([rig_b.between(10, 11)]) is None


def test_the_result_names_the_method_that_fitted(rig_b: Recording) -> None:
    result = h3.identify(rig_b.between(0.0, 15.0))
    assert result.method == "freeflight"
    assert result.to_dict()["method"] == "freeflight"
    assert result.model.name == "freeflight"
    text = "\n".join(result.sentences())
    assert "likelihood (extended Kalman filter" not in text
    assert any("Fitted to free-run predictions" in w for w in result.warnings)


def test_recordings_that_lack_an_angle_do_not_prevent_the_switch(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The recording with all angles decides, and the warning names the one that is not fitted."""
    whole = without_loop(fly(1310, "rich").recording.between(0, 30))
    only_roll = replace(
        whole, angle=whole.angle * [1, np.nan, np.nan], meta={**whole.meta, "name": "only-roll"}
    )
    monkeypatch.setattr("heli3dof.identification.greybox.noise_check.has_jitter", lambda r: True)
    one_round = partial(search, stages_s=((0.25,),), rounds=1)
    monkeypatch.setattr("heli3dof.identification.greybox.freeflight.search", one_round)
    result = h3.identify([whole, only_roll])
    assert (result.method, result.model.name) == ("freeflight", "freeflight")
    assert any("but not only-roll: an angle" in w for w in result.warnings)
