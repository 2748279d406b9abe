"""Counters of recordings and drivers are read under their former names too."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import pytest
from heli3dof_recordings import references

from heli3dof.experiment.control_loop.timekeeping import CountedDeadlines, timekeeper
from heli3dof.recording.mcap_files.reader import read_recording
from heli3dof.recording.write import write_recording
from heli3dof.rig.link_counters import attribute_of, present_names
from tests.cli.running import heli3dof

FORMER = {"periods": 9, "left_out": 3, "link": {"lost": 1, "passed_over": 2, "damaged": 4,
          "repeats": 5, "unheard": 6}}  # fmt: skip
PRESENT = {"periods": 9, "device_skipped": 3, "link": {"lost": 1, "samples_stale": 2,
           "malformed": 4, "retries": 5, "commands_unacknowledged": 6}}  # fmt: skip


def test_former_names_become_present_ones() -> None:
    assert present_names(FORMER) == present_names(PRESENT) == PRESENT
    assert present_names({"link": None}) == {"link": None}


def test_info_reads_a_recording_with_former_names(tmp_path: Path) -> None:
    recording = read_recording(next(iter(references())).path)
    recording.meta["outcome_details"] = FORMER
    path = tmp_path / "old.mcap"
    write_recording(recording, path)
    report = heli3dof("info", str(path), "--json")
    assert report.code == 0
    assert report.document["outcome_details"] == PRESENT
    assert "3 (no sample taken by the device)" in heli3dof("info", str(path)).out


@dataclass
class FormerStatistics:
    lost: int = 0
    left_out: int = 0
    passed_over: int = 0


def test_a_driver_with_former_names_is_used_with_a_warning() -> None:
    rig = SimpleNamespace(
        identity=SimpleNamespace(timebase="device"), statistics=FormerStatistics()
    )
    with pytest.warns(DeprecationWarning, match="FormerStatistics.* is now called"):
        assert isinstance(timekeeper(rig, 0.002), CountedDeadlines)  # type: ignore[arg-type]
    assert attribute_of(object(), "retries") is None
