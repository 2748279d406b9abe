"""Whether a likelihood's noise is believed: of mock flights yes, of a real rig's shaking no."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import heli3dof as h3
from heli3dof.identification.greybox.noise_check import (
    CLOCK,
    NoiseCheck,
    noise_check,
    why_freeflight,
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


def test_white_noise_of_a_tenth_loses_3_3_degrees_in_a_second() -> None:
    """0.1 rad/s²/√Hz · √(1/3 s³) = 0.0577 rad"""
    check = NoiseCheck(np.full(3, 0.1), np.full(3, 5.0))
    assert check.expected_deg == pytest.approx(np.full(3, 3.308), abs=0.001)


def test_noise_is_none_only_where_it_is_loud_and_predictions_do_not_show_it() -> None:
    loud, usual = np.array([0.05, 2.0, 0.05]), np.array([0.05, 0.15, 0.05])
    assert not NoiseCheck(loud, np.full(3, 10.0)).believed
    assert NoiseCheck(loud, np.full(3, 60.0)).believed
    assert NoiseCheck(usual, np.full(3, 0.1)).believed


@pytest.mark.parametrize("hide", ["", "encoder.backlash.pitch:0.5", "motor.lag:0.1"])
def test_a_mock_flight_bears_a_likelihood_whatever_it_hides(hide: str) -> None:
    assert why_freeflight([without_loop(fly(1310, "rich", hide=hide).recording)]) == ""


def test_a_rig_that_shakes_does_not_and_is_told_why(rig_b: Recording) -> None:
    check = noise_check([rig_b])
    assert check is not None
    assert check.overstated.tolist() == [False, True, False]
    why = why_freeflight([rig_b])
    assert "on pitch" in why
    assert why != CLOCK


def test_a_second_of_flight_says_nothing(rig_b: Recording) -> None:
    assert noise_check([rig_b.between(10, 11)]) is None


def test_what_is_handed_over_names_the_method_that_fitted_it(rig_b: Recording) -> None:
    found = h3.identify(rig_b)
    assert found.method == "freeflight"
    assert found.to_dict()["method"] == "freeflight"
    said = "\n".join(found.sentences())
    assert "likelihood (extended Kalman filter" not in said
    assert any("Fitted to free flights" in w for w in found.warnings)
