"""Simplified equations are detected on a simplified rig and not on a full rigid body."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from heli3dof.identification.bias_correction.simulated_flight import simulated_flight
from heli3dof.identification.greybox.method import fit_greybox
from heli3dof.identification.greybox.structure_test import (
    SIMPLIFICATIONS,
    score_and_curvature,
    with_simplifications,
)
from heli3dof.identification.identify import Identification, identify
from heli3dof.model.effects import terms
from heli3dof.model.greybox.model import nominal
from heli3dof.recording.recording import Recording
from tests.flown import flown as flight

ALWAYS = ("motor.lag",)


@cache
def mock_flight() -> Recording:
    return flight("rich", 40.0, device="mock:?speed=max&seed=1821", seed=1821)


def flown(*simplified: str) -> Recording:
    """The plan rich, simulated with our equations and a quiet rig's noise; lag 50 ms."""
    mock = mock_flight()
    model = nominal(mock.profile, (*ALWAYS, *simplified), **{"motor.lag.time_constant_s": 0.05})
    model = replace(model, noise=np.array([0.004, 0.01, 0.003]))
    return simulated_flight(model, mock, np.random.default_rng(1821))


@pytest.fixture(scope="module")
def simple() -> Recording:
    return flown(*SIMPLIFICATIONS)


@pytest.fixture(scope="module")
def identified(simple: Recording) -> Identification:
    return identify(simple)


def test_the_yaw_inertia_of_a_simplified_rig_is_right(
    simple: Recording, identified: Identification
) -> None:
    nominal_J = identified.found.parameters["J_yaw"].nominal
    result = identified.found.parameters["J_yaw"]
    assert abs(result.value / nominal_J - 1) < 0.015
    # The full equations are 4 % off, many of their standard deviations.
    whole = fit_greybox(simple)
    j = whole.structure.names.index("J_yaw")
    assert abs(whole.values[j] / nominal_J - 1) > 0.025
    assert abs(whole.values[j] - nominal_J) > 4 * whole.std[j]


def test_simplifications_are_parameters_and_notes(identified: Identification) -> None:
    for way in SIMPLIFICATIONS:
        share = identified.found.parameters[f"{way}.share"]
        assert share.value == pytest.approx(1, abs=4 * share.std)
    assert {t.effect.summary for t in terms(SIMPLIFICATIONS)} <= set(identified.found.notes)


def test_a_missing_yaw_inertia_variation_is_detected_separately() -> None:
    result = with_simplifications(fit_greybox(flown("simplified.yaw_inertia")))
    assert [t.name for t in result.structure.terms if t.effect.formal] == ["simplified.yaw_inertia"]


def test_a_full_rigid_body_is_not_refitted() -> None:
    result = fit_greybox(flown())
    assert with_simplifications(result) is result
    g, V = score_and_curvature(result)
    # Leaving out everything would cost more than 100 of log-likelihood.
    assert g.sum() - 0.5 * V.sum() < -100


def test_requested_terms_are_not_changed(simple: Recording) -> None:
    result = identify(simple, terms=ALWAYS)
    assert not any(n.startswith("simplified") for n in result.found.parameters)
