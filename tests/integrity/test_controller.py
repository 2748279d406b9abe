from __future__ import annotations

from dataclasses import replace

import numpy as np

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
    assert "as for an unknown controller" in found.sentence
    assert "[controller]" in found.fix
    assert Diagnosis(("flight",), (), "nothing_found", (found,)).in_order == ()


def test_a_gain_that_is_right_to_a_percent_is_no_finding() -> None:
    faults = integrity(with_gain(flight("run-step"), 1.01))
    assert not [f for f in faults if f.check == "controller.voltage"]


def test_an_excitation_that_was_not_logged_is_a_note() -> None:
    r = flight()
    found = fault(replace(r, voltage_extra=np.full_like(r.voltage, np.nan)))
    assert found.kind == Kind.NOTE
    assert "v_front_extra_V" in found.fix
