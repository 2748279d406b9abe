"""`diagnose` end to end: a hidden effect is named with its size, and an unmodified rig has none."""

from __future__ import annotations

import json

import pytest

from heli3dof.diagnosis.diagnose import diagnose
from heli3dof.diagnosis.document import diagnosis_document as to_document
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import Plan, step_plan
from heli3dof.recording.recording import Recording
from tests.flown import first_part


def flight(plan: Plan, hide: str, seed: int) -> Recording:
    device = f"mock:?speed=max&hide={hide}&seed={seed}&spread=0.07"
    return fly_plan(plan, device=device, seed=seed).recording


def test_a_cable_stiffness_in_yaw_is_named_with_its_size() -> None:
    recording = flight(first_part("rich", 30.0), "stiffness.cable.yaw:0.1", 1101).between(0.0, 30.0)
    result = diagnose(recording, quick=True)
    assert [f.term.name for f in result.findings] == ["stiffness.cable.yaw"]
    value, std = result.findings[0].values["stiffness_Nm_per_rad"]
    assert value == pytest.approx(0.1, abs=max(4 * std, 0.01))
    assert result.findings[0].gain.log_likelihood.low > 50
    written = json.loads(json.dumps(to_document(result)))
    assert written["schema"] == "heli3dof.diagnosis/1"
    assert written["verdict"] == "explained"
    assert written["findings"][0]["axis"] == "yaw"
    assert set(written["about"]["seconds"]) >= {"base", "screen 1", "fits 1", "gain"}


def test_a_step_flight_of_the_unmodified_rig_has_no_finding() -> None:
    result = diagnose(flight(step_plan((10.0, None, None)), "", 1102), quick=True)
    assert result.verdict == "off_calibration"  # the rig is up to 7 % off its profile
    assert not result.findings
    assert "drag.quadratic.yaw" in result.not_identifiable
