"""Short versions of the runs of `make bench TOPIC=loop`: strict on behaviour, not on lateness."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
import pytest

from heli3dof.recording.mcap_files.reader import read_recording
from tests.drivers.firmware.building import rig_program
from tests.profiles import PATIENT, STALL_S, START_S, write_profile
from tests.realtime.flight import RAMP_DOWN_S, FlightProcess, firmware
from tests.realtime.kill import kill_flights
from tests.realtime.power import lost_to_a_power_cut
from tests.realtime.soak import soak

pytestmark = [
    pytest.mark.realtime,
    pytest.mark.skipif(sys.platform != "linux", reason="reads /proc"),
]
WATCHDOG_S, RAMP_S = 0.5, 0.2
SLACK = ("--watchdog", f"{WATCHDOG_S * 1e3:g}")
"""A busy machine may stall for longer than the firmware's default of 100 ms."""


def test_a_flight_on_the_firmware_is_recorded_completely_with_the_live_view(tmp_path: Path) -> None:
    profile = write_profile(tmp_path / "patient.toml", **PATIENT)
    with (
        firmware(rig_program(), *SLACK) as device,
        FlightProcess(device, tmp_path / "a.mcap", 4, profile=profile) as flight,
    ):
        document = flight.result(START_S)
    assert b"flying" in flight.shown, "the live view was on"
    assert (document["outcome"], document["landed"]) == ("completed", True)
    recording = read_recording(tmp_path / "a.mcap")
    periods = 500 * (6 + RAMP_DOWN_S)
    skipped = sum(document[f"{reason}_periods"] for reason in ("missed", "lost", "left_out"))
    assert periods - skipped - 1 <= len(recording) <= periods + 1
    # Gaps in the device's time are exactly the skipped periods. The line loses none; a busy machine
    # may hold up either end.
    assert document["lost_periods"] == 0
    t = recording.channels["device_time_s"]
    assert np.diff(t).min() > 0
    assert abs(round(float(t[-1] - t[0]) * 500) - (len(t) - 1) - skipped) <= 2
    assert document["punctuality"]["median_s"] < 0.01
    assert document["link"]["lost"] == 0
    assert document["link"]["device_skipped"] == document["left_out_periods"]
    assert 0 < document["link"]["delay_median_s"] < 0.01


def test_a_flight_without_permissions_completes_and_reports_them(tmp_path: Path) -> None:
    device = "mock:?speed=real&start=level&watchdog_s=0.5"
    profile = write_profile(tmp_path / "patient.toml", **PATIENT)
    path, without = tmp_path / "a.mcap", ["permissions"]
    with FlightProcess(device, path, 1, profile=profile, without=without) as flight:
        document = flight.result(START_S)
    assert document["realtime"]["scheduled"] is False
    assert {r["what"] for r in document["realtime"]["refused"]} == {
        "real-time scheduling", "locked memory",
    }  # fmt: skip
    kept = read_recording(tmp_path / "a.mcap").meta["outcome_details"]
    assert kept["realtime"] == document["realtime"]


def test_kill_9_ends_at_zero_volts_and_loses_half_a_second_at_most(tmp_path: Path) -> None:
    log = tmp_path / "device.log"
    with firmware(rig_program(), *SLACK, "--log", str(log)) as device:
        flights = list(kill_flights(device, log, tmp_path, 2, seed=1))
    for flight in flights:
        assert flight.zero_s <= WATCHDOG_S + RAMP_S + 2 * STALL_S, "after watchdog and ramp"
        assert flight.lost_s <= 0.5 + STALL_S, "of flight before the kill"
        assert flight.rows > 0


def test_a_power_cut_loses_half_a_second_on_a_fast_disk(tmp_path: Path) -> None:
    lost_s = lost_to_a_power_cut(tmp_path / "a.mcap", 3, sync=lambda descriptor: None)
    assert lost_s <= 0.5 + 0.5, "with half a second for a busy machine"


def test_a_power_cut_loses_more_on_a_slow_disk(tmp_path: Path) -> None:
    lost_s = lost_to_a_power_cut(tmp_path / "a.mcap", 3, sync=lambda descriptor: time.sleep(0.7))
    assert lost_s > 0.7


def test_the_memory_of_a_flight_is_read_until_it_completes(tmp_path: Path) -> None:
    """`make bench TOPIC=soak` judges the growth: the traces of the live view fill for 15 s."""
    result = soak("mock:?speed=real&start=level&watchdog_s=0.5", tmp_path, 10)
    assert result.flight["outcome"] == "completed"
    assert result.flown_min == pytest.approx(9 / 60, abs=0.02)
    assert 20 < result.first_MiB <= result.last_MiB + 1 < 300


def test_a_written_profile_is_read_back(tmp_path: Path) -> None:
    from heli3dof.rig.profile import load_profile

    profile = load_profile(write_profile(tmp_path / "p.toml", rate_hz=1000, duration_max_s=700))
    assert (profile.loop.rate_hz, profile.limits.duration_max_s) == (1000, 700)
