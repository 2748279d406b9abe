"""The summary of a recording file."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from heli3dof.cli.info import _rows
from heli3dof.errors import RecordingError
from heli3dof.recording.info import file_info, summary
from heli3dof.recording.logs.export import export
from heli3dof.recording.row import CLOSED_LOOP, RAMP_DOWN
from heli3dof.recording.write import write_recording
from tests.recording.make import changed, empty, flight, open_profile, write_flight


def test_a_flight_is_summarised_with_its_plan_outcome_and_lateness(tmp_path: Path) -> None:
    about = file_info(write_flight(tmp_path / "a.mcap", 1201))
    json.dumps(about)
    assert about["samples"] == 1201
    assert about["duration_s"] == pytest.approx(2.4)
    assert about["timing"]["rate_hz"] == pytest.approx(500)
    assert about["timing"]["gaps"] == 0
    assert about["profile"] == "table-1"
    assert about["loop_is_known"]
    assert about["plan"] == {"roll_deg": 10}
    assert about["outcome"] == "completed"
    assert about["lateness"]["max_s"] == pytest.approx(1200e-6)
    assert about["lateness"]["late_ticks"] == 200  # 1001 … 1200 µs
    assert about["angles"]["yaw"]["max_deg"] == pytest.approx(3 * 1200 * 360 / 8192)
    assert about["torn"] is False
    assert "roll_count" in about["channels"]


def test_the_time_in_closed_loop_counts_lost_samples_but_not_the_ramp() -> None:
    made = flight(1000)
    phase = np.repeat([CLOSED_LOOP, RAMP_DOWN], 500).astype(float)
    made = replace(made, channels={**made.channels, "phase": phase})
    kept = np.r_[0:100, 300:1000]
    assert summary(made.rows(kept))["closed_loop_s"] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("in_ramp", "volts", "way", "text"),
    [
        (0, 5.0, None, None),
        (50, 5.0, "ramp", "ramp to zero"),
        (50, 0.0, "at_once", "zero volts at once"),
    ],
)
def test_the_rows_show_how_the_voltages_went_to_zero(
    in_ramp: int, volts: float, way: str | None, text: str | None
) -> None:
    made = flight(100)
    phase = np.where(np.arange(100) < 100 - in_ramp, CLOSED_LOOP, RAMP_DOWN)
    made = replace(made, channels={**made.channels, "phase": phase})
    about = summary(changed(made, "voltage", phase == RAMP_DOWN, volts))
    length = dict(_rows(about))["length"]
    assert about["way_down"] == way
    assert (f"s in closed loop, then {text})" in length) == ("closed loop" in length) == bool(way)


def test_gaps_are_counted_and_warnings_shown(tmp_path: Path) -> None:
    made = flight(500)
    keep = np.ones(500, bool)
    keep[[50, 51, 52, 200]] = False
    log = export(made.rows(keep), tmp_path / "a.csv")
    about = file_info(log, open_profile())
    json.dumps(about)
    assert about["timing"]["gaps"] == 2
    assert about["timing"]["lost_share"] == pytest.approx(4 / 500)
    assert about["timing"]["longest_gap_s"] == pytest.approx(0.008)
    assert any("2 gaps" in w for w in about["warnings"])
    assert not about["loop_is_known"]
    assert about["provenance"]["log"]["file"] == "a.csv"


def test_a_torn_file_is_summarised_up_to_the_tear(tmp_path: Path) -> None:
    path = write_flight(tmp_path / "a.mcap", 500)
    path.write_bytes(path.read_bytes()[:-1])
    about = file_info(path)
    assert about["torn"] is True
    assert about["samples"] == 500
    assert about["fix"] == f"heli3dof recover {path}"
    assert about["warnings"] == [], "the outcome is there, and no sample is lost"


def test_a_file_with_wrong_bytes_is_summarised_without_their_chunks(tmp_path: Path) -> None:
    path = write_flight(tmp_path / "a.mcap", 500)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    about = file_info(path)
    assert about["torn"] is True
    assert 0 < about["samples"] < 500
    assert "checksum" in about["damage"]


def test_a_file_torn_before_its_first_sample_is_an_error(tmp_path: Path) -> None:
    path = write_flight(tmp_path / "a.mcap", 0)
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(RecordingError, match="torn"):
        file_info(path)


def test_the_same_data_have_the_same_digest_in_memory_and_in_a_file(tmp_path: Path) -> None:
    made = flight(100)
    about = file_info(write_recording(made, tmp_path / "a.mcap"))
    assert about["digest"] == summary(made)["digest"]


def test_a_recording_without_rows_is_summarised_without_ranges() -> None:
    about = summary(empty())
    json.dumps(about, allow_nan=False)
    assert (about["samples"], about["voltage"]["min_V"], about["timing"]) == (0, None, None)


def test_a_stopped_device_clock_gives_a_warning() -> None:
    made = flight(100)
    backwards = replace(made, t=made.t[::-1])
    assert summary(backwards)["duration_s"] == pytest.approx(made.duration)
    made = changed(made, "t", slice(50, 60), made.t[50])
    about = summary(made)
    assert about["timing"] is None
    assert any("the time does not increase at 9 of 100 samples" in w for w in about["warnings"])


def test_a_slow_link_gives_a_warning() -> None:
    made = flight(100)
    latency = {"commands": 100, "commands_unacknowledged": 100, "median_s": 12e-3}
    slow = replace(made, meta={**made.meta, "outcome_details": {"latency": latency}})
    assert any("12.0 ms (median)" in w for w in summary(slow)["warnings"])


def test_the_first_time_is_stated() -> None:
    r = flight(50)
    assert summary(replace(r, t=r.t + 37))["start_s"] == pytest.approx(37 + r.t[0])
