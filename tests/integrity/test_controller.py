from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.diagnosis.result import Diagnosis
from heli3dof.integrity import Kind, integrity
from heli3dof.integrity.base import Fault
from heli3dof.recording.recording import Recording
from tests.integrity.flights import flight


def fault(recording: Recording) -> Fault:
    (only,) = (f for f in integrity(recording) if f.check == "controller.voltage")
    return only


def with_gain(recording: Recording, factor: float) -> Recording:
    spec = recording.profile.controller
    assert spec is not None
    profile = recording.profile.with_gain(factor * np.array(spec.K))
    return replace(recording, profile=profile)


def test_a_wrong_gain_in_the_profile_is_a_finding_with_the_way_out() -> None:
    found = fault(with_gain(flight("run-step"), 1.3))
    assert found.kind == Kind.FINDING
    assert found.effect is None
    assert "does not use this controller" in found.sentence
    assert "[controller]" in found.fix
    assert Diagnosis(("flight",), (), "nothing_found", (found,)).in_order == ()


@pytest.mark.parametrize("why", ["other gains", "no controller"])
def test_the_controller_is_identified_if_the_profile_s_cannot_be_used(why: str) -> None:
    r = flight("run-step")
    if why == "other gains":
        r = with_gain(r, 1.3)
    else:
        r = replace(r, profile=r.profile.model_copy(update={"controller": None}))
    (found,) = (f for f in integrity(r) if f.check == "controller.identified")
    assert found.kind == Kind.NOTE
    known = why == "other gains"
    assert ("another controller" in found.sentence) == known
    assert ("no [controller]" in found.sentence) != known
    assert "It explains 9" in found.sentence
    assert found.cause == ""
    assert "order 3" in found.sentence  # an integral, and rates by a filter of second order


def test_the_profile_s_controller_is_not_identified_again() -> None:
    assert not [f for f in integrity(flight("run-step")) if f.check == "controller.identified"]


def test_a_gain_that_is_right_to_a_percent_is_no_finding() -> None:
    faults = integrity(with_gain(flight("run-step"), 1.01))
    assert not [f for f in faults if f.check == "controller.voltage"]


def test_an_excitation_that_was_not_logged_is_a_note() -> None:
    r = flight()
    found = fault(replace(r, voltage_extra=np.full_like(r.voltage, np.nan)))
    assert found.kind == Kind.NOTE
    assert "v_front_extra_V" in found.fix
