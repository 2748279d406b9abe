"""A whole flight: the order of closing, warnings, and a recording that disappears."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from heli3dof.errors import Heli3dofError, RecordingError, SafetyTrip
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import step_plan
from heli3dof.recording.mcap_files.flight_recorder import RecordingWriter
from heli3dof.recording.mcap_files.reader import read_recording
from heli3dof.rig.session.stoppable_rig import StoppableRig

SHORT = step_plan((None, None, None), settle_s=0.2, duration_s=0.2)


def test_the_device_is_disarmed_before_the_recording_is_finished(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    order: list[str] = []
    close, outcome = StoppableRig.close, RecordingWriter.outcome

    def closed(self: StoppableRig) -> None:
        order.append("device")
        close(self)

    def written(self: RecordingWriter, *about: Any, **details: Any) -> None:
        order.append("recording")
        outcome(self, *about, **details)

    monkeypatch.setattr(StoppableRig, "close", closed)
    monkeypatch.setattr(RecordingWriter, "outcome", written)
    fly_plan(SHORT, device="mock:?speed=max&start=level", output=tmp_path / "f.mcap")
    assert order[:2] == ["device", "recording"]


@pytest.mark.parametrize(
    ("fault", "error", "first"),
    [
        ("", RecordingError, "The flight was completed, but its recording is no longer at "),
        ("&fault=frozen.roll@0.05", SafetyTrip, "The flight was ended for safety: "),
    ],
)
def test_the_outcome_of_a_flight_whose_file_was_moved_is_reported_first(
    fault: str, error: type[Heli3dofError], first: str, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    path = tmp_path / "b.mcap"
    outcome = RecordingWriter.outcome

    def moved(self: RecordingWriter, *about: Any, **details: Any) -> None:
        outcome(self, *about, **details)
        path.rename(tmp_path / "a.mcap")

    monkeypatch.setattr(RecordingWriter, "outcome", moved)
    with pytest.raises(error) as caught:
        fly_plan(SHORT, device=f"mock:?speed=max&start=level{fault}", output=path)
    assert caught.value.what.startswith(first)
    assert "no longer at" in caught.value.what
    assert len(read_recording(tmp_path / "a.mcap"))


def test_a_flight_warns_of_a_step_below_two_counts_and_of_an_unusual_ending(tmp_path: Path) -> None:
    said: list[str] = []
    plan = step_plan(roll=0.17, settle_s=0.2, duration_s=0.2)  # 10° in rad; a count is 0.088°
    rig = "mock:?speed=max&start=level"
    fly_plan(plan, device=rig, output=tmp_path / "f.txt", warn=said.append)
    ending, step = said
    assert "f.txt will be an MCAP recording" in ending
    assert "roll's reference moves by 0.17° only, 1.9 encoder counts" in step
    assert "0.17 rad would be 9.7°" in step
    fly_plan(SHORT, device=rig, output=tmp_path / "f.mcap", warn=said.append)
    assert len(said) == 2
