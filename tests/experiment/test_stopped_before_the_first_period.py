"""An emergency stop before the flight ends it with exit code 4, and its file holds the reason."""

from __future__ import annotations

from pathlib import Path

import pytest

from heli3dof.errors import SafetyTrip
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import step_plan
from heli3dof.rig.session.estop import request_estop
from tests.cli.running import heli3dof

PLAN = step_plan((1.0, None, None), settle_s=0.1, duration_s=0.2)


@pytest.fixture(autouse=True)
def runtime(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))


def refused(output: Path | None) -> SafetyTrip:
    request_estop(None, "smoke")
    with pytest.raises(SafetyTrip, match="emergency stop on request: smoke") as caught:
        fly_plan(PLAN, device="mock:?speed=max", output=output)
    assert "not armed" in caught.value.what
    assert caught.value.exit_code == 4
    return caught.value


def test_a_flight_in_memory_is_refused() -> None:
    refused(None)


def test_a_flight_to_a_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "flight.mcap"
    assert str(path) in refused(path).what
    info = heli3dof("info", path)
    assert info.code == 5
    assert "contains no samples: tripped, emergency stop on request: smoke" in info.err
