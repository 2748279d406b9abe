"""A rig by simplified equations is identified as one; a whole body is not mistaken for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.diagnosis.noisy_flight import noisy_flight
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import load_plan
from heli3dof.identification.greybox.method import fit_greybox
from heli3dof.identification.greybox.structure_test import WAYS, as_written, left_out
from heli3dof.identification.identify import Identification, identify
from heli3dof.model.effects import terms
from heli3dof.model.greybox.model import nominal
from heli3dof.recording.recording import Recording

ALWAYS = ("motor.lag",)


def flown(*simplified: str) -> Recording:
    """The rich plan, flown by our own equations by the quiet noise of a good rig; lag 50 ms."""
    mock = fly_plan(load_plan("rich"), device="mock:?speed=max&seed=1821", seed=1821).recording
    model = nominal(mock.profile, (*ALWAYS, *simplified), **{"motor.lag.time_constant_s": 0.05})
    model = replace(model, noise=np.array([0.004, 0.01, 0.003]))
    return noisy_flight(model, mock.between(0.0, 40.0), np.random.default_rng(1821))


@pytest.fixture(scope="module")
def simple() -> Recording:
    return flown(*WAYS)


@pytest.fixture(scope="module")
def identified(simple: Recording) -> Identification:
    return identify(simple)


def test_written_as_it_is_the_rigs_yaw_inertia_comes_out_right(
    simple: Recording, identified: Identification
) -> None:
    nominal_J = identified.found.parameters["J_yaw"].nominal
    found = identified.found.parameters["J_yaw"]
    assert abs(found.value / nominal_J - 1) < 0.015
    # The whole body's equations are 4 % off, many times what they believe.
    whole = fit_greybox(simple)
    j = whole.structure.names.index("J_yaw")
    assert abs(whole.values[j] / nominal_J - 1) > 0.025
    assert abs(whole.values[j] - nominal_J) > 4 * whole.std[j]


def test_what_was_left_out_is_among_the_parameters_and_said(identified: Identification) -> None:
    for way in WAYS:
        share = identified.found.parameters[f"{way}.share"]
        assert share.value == pytest.approx(1, abs=4 * share.std)
    assert {t.effect.summary for t in terms(WAYS)} <= set(identified.warnings)


def test_one_that_leaves_out_the_turning_inertia_alone_is_told_from_both() -> None:
    found = as_written(fit_greybox(flown("simplified.yaw_inertia")))
    assert [t.name for t in found.structure.terms if t.effect.formal] == ["simplified.yaw_inertia"]


def test_a_whole_body_stays_whole_and_no_second_fit_is_made() -> None:
    found = fit_greybox(flown())
    assert as_written(found) is found
    g, V = left_out(found)
    # All of it left out would cost a hundred and more of log-likelihood.
    assert g.sum() - 0.5 * V.sum() < -100


def test_terms_that_were_asked_for_are_taken_as_they_are(simple: Recording) -> None:
    found = identify(simple, terms=ALWAYS)
    assert not any(n.startswith("simplified") for n in found.found.parameters)
