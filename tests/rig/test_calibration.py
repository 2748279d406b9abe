"""Rest angles are stored per serial number, and hold until the device restarts."""

from __future__ import annotations

import time
from dataclasses import replace
from datetime import UTC, datetime

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from heli3dof.rig.calibration import (
    Calibration,
    calibration_path,
    load_calibration,
    rest_counts_of,
    store_calibration,
)
from heli3dof.rig.clock import UPTIME_WRAP_S
from tests.rig.fakes import IDENTITY

FOUND = Calibration(
    "F-1", 7, (4096, 4096, 8192), (12, -3, 40), "2026-11-21T07:00:00+00:00", "fake://1"
)


@pytest.fixture(autouse=True)
def state(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    return tmp_path


def test_a_rig_without_a_calibration_is_assumed_to_have_started_at_rest():
    rest = rest_counts_of(IDENTITY)
    assert (rest.counts_at_rest, rest.known_from, rest.note) == ((0, 0, 0), "power-up", "")


def test_stored_counts_are_used_without_a_note(state):
    path = store_calibration(FOUND)
    assert path == state / "heli3dof" / "rigs" / "F-1.toml"
    rest = rest_counts_of(IDENTITY)
    assert (rest.counts_at_rest, rest.known_from, rest.note) == ((12, -3, 40), "zero", "")


def test_after_a_restart_of_the_device_stored_counts_are_not_used_and_a_note_says_so():
    store_calibration(FOUND)
    rest = rest_counts_of(replace(IDENTITY, boot=8))
    assert rest.counts_at_rest == (0, 0, 0)
    assert "has restarted since heli3dof zero on 2026-11-21" in rest.note


def test_without_boot_numbers_stored_counts_are_used_and_a_note_names_their_date():
    store_calibration(replace(FOUND, boot=None))
    rest = rest_counts_of(replace(IDENTITY, boot=None))
    assert rest.counts_at_rest == (12, -3, 40)
    assert "2026-11-21" in rest.note


def test_stored_counts_of_other_encoders_are_not_used():
    store_calibration(FOUND)
    rest = rest_counts_of(replace(IDENTITY, counts_per_rev=(-4096, 4096, 8192)))
    assert rest.counts_at_rest == (0, 0, 0)
    assert "run heli3dof zero again" in rest.note


@pytest.mark.parametrize(
    "text",
    ["", "serial = ", "serial = 'F-1'\n", "\x00", "serial = 'F-2'\n" + "x = 1\n"],
)
def test_a_damaged_file_is_not_used_and_a_note_says_so(text):
    path = store_calibration(FOUND)
    path.write_text(text)
    rest = rest_counts_of(IDENTITY)
    assert rest.counts_at_rest == (0, 0, 0)
    assert "cannot be read" in rest.note


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(
    serial=st.text(st.characters(codec="utf-8"), min_size=1, max_size=40),
    boot=st.none() | st.integers(0, 2**32 - 1),
    counts=st.tuples(*[st.integers(-(2**31), 2**31 - 1)] * 3),
)
def test_a_stored_calibration_is_read_back(serial, boot, counts):
    stored = replace(FOUND, serial=serial, boot=boot, counts_at_rest=counts, started_s=1.5e9)
    path = store_calibration(stored)
    assert load_calibration(serial) == stored
    path.unlink()


def test_a_serial_number_cannot_leave_its_folder(state):
    assert calibration_path("../../etc/passwd").parent == state / "heli3dof" / "rigs"
    assert calibration_path("..").name == "...toml"


def zeroed(started_s: float | None, ago_s: float, boot: int | None = 7) -> None:
    when = datetime.fromtimestamp(time.time() - ago_s, UTC).isoformat(timespec="seconds")
    store_calibration(replace(FOUND, boot=boot, zeroed_utc=when, started_s=started_s))


@pytest.mark.parametrize("up_before_s", [60.0, 3600.0])
@pytest.mark.parametrize("ago_s", [30.0, 3600.0])
def test_a_repeated_boot_number_does_not_hide_a_restart(up_before_s: float, ago_s: float):
    now = time.time()
    zeroed(now - ago_s - up_before_s, ago_s)
    rest = rest_counts_of(replace(IDENTITY, started_s=now - ago_s / 2))
    assert rest.counts_at_rest == (0, 0, 0)
    assert "its boot number 7 is the same" in rest.note
    assert "run heli3dof zero again" in rest.note


@pytest.mark.parametrize("ago_s", [1.0, 3600.0, 86400.0, 40 * 86400.0, 60 * 86400.0])
@pytest.mark.parametrize("off", [-4e-3, 0.0, 4e-3])
def test_a_device_without_a_restart_keeps_its_rest_angles_with_any_crystal(
    ago_s: float, off: float
):
    started = time.time() - ago_s - 100
    zeroed(started, ago_s)
    # A slow clock states a shorter uptime, as if it had started later. Modulo 49.7 days.
    stated = (ago_s + 100) * (1 - off) % UPTIME_WRAP_S
    rest = rest_counts_of(replace(IDENTITY, started_s=time.time() - stated))
    assert (rest.counts_at_rest, rest.note) == ((12, -3, 40), "")


def test_without_boot_numbers_the_uptime_detects_a_restart():
    now = time.time()
    zeroed(now - 500, 100, boot=None)
    same = replace(IDENTITY, boot=None, started_s=now - 500)
    assert rest_counts_of(same).counts_at_rest == (12, -3, 40)
    assert rest_counts_of(same).note == ""
    other = rest_counts_of(replace(same, started_s=now - 50))
    assert other.counts_at_rest == (0, 0, 0)
    assert "has restarted since" in other.note


@pytest.mark.parametrize("text", ["started_s = 'noon'", "started_s = true"])
def test_a_start_that_is_not_a_number_is_damage(text: str):
    path = store_calibration(FOUND)
    path.write_text(path.read_text() + text + "\n")
    assert "cannot be read" in rest_counts_of(IDENTITY).note
