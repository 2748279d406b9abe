"""The whole of `diagnose`: a hidden effect is named with its size, nothing where nothing is."""

from __future__ import annotations

import json

import pytest

from heli3dof.diagnosis import diagnose as module
from heli3dof.diagnosis.diagnose import diagnose
from heli3dof.diagnosis.document import document as to_document
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import load_plan
from heli3dof.recording.recording import Recording


def flight(hide: str, seed: int) -> Recording:
    device = f"mock:?speed=max&start=level&hide={hide}"
    flown = fly_plan(load_plan("rich"), device=device, seed=seed).recording
    return flown.between(0.0, 30.0)


@pytest.fixture(autouse=True)
def few_nulls(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "QUICK_FLIGHTS", 6)


def test_a_cable_stiffness_in_yaw_is_named_and_its_size_is_right() -> None:
    found = diagnose(flight("stiffness.cable.yaw:0.1", 1101), quick=True)
    assert [f.choice.term.name for f in found.findings] == ["stiffness.cable.yaw"]
    value, std = found.findings[0].values["stiffness_Nm_per_rad"]
    assert value == pytest.approx(0.1, abs=max(4 * std, 0.005))
    assert found.findings[0].log_likelihood > 50
    written = json.loads(json.dumps(to_document(found)))
    assert written["schema"] == "heli3dof.diagnosis/1"
    assert written["verdict"] == "explained"
    assert written["findings"][0]["axis"] == "yaw"


def test_nothing_is_found_where_nothing_is_hidden() -> None:
    found = diagnose(flight("", 1102), quick=True)
    assert found.verdict == "nothing_found"
    assert not found.findings
