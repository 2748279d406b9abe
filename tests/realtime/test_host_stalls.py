"""Late periods are attributed to host stalls, to the firmware, or to neither."""

from __future__ import annotations

import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from tests.realtime.host_stalls import WRAP, Stalls, host_stalls, lateness, written_late

DT = 2e-3


def flight(skipped: dict[int, int], late_s: dict[int, float], start_s: float = 0.0) -> Any:
    """Ten samples, with periods skipped before some and lateness of some."""
    device = start_s + DT * np.cumsum([1 + skipped.get(k, 0) for k in range(10)])
    late = np.array([late_s.get(k, 0.0) for k in range(10)])
    channels = {
        "host_time_s": 100 + device - start_s + late, "lateness_s": late, "device_time_s": device,
    }  # fmt: skip
    return cast(Any, SimpleNamespace(channels=channels, dt=DT))


def test_late_and_missed_periods_in_a_host_stall_are_attributed_to_it() -> None:
    # Sample 6 comes after three missed periods and is late itself.
    rows = flight({6: 3}, {3: 4e-3, 6: 7.5e-3})
    result = lateness(rows, Stalls())
    assert (result.late, result.stalled, result.device, result.own) == (5, 0, 0, 5)
    assert (result.own_times, result.own_worst_s) == (2, 7.5e-3)
    # Sample 6 was due at 100.020; the host stalled until just before.
    result = lateness(rows, Stalls([(100.013, 100.0195)]))
    assert (result.late, result.stalled, result.own, result.own_times) == (5, 4, 1, 1)


def test_left_out_and_lost_samples_are_no_lateness() -> None:
    assert lateness(flight({6: 3}, {6: 0.4e-3}), Stalls()).late == 0
    assert lateness(flight({6: 3}, {6: 1.4e-3}), Stalls()).late == 1


def test_a_sample_that_the_firmware_wrote_late_is_attributed_to_it() -> None:
    start_s = (WRAP - 3000) * 1e-6  # the device's clock wraps within the flight
    rows = flight({}, {3: 1.5e-3, 5: 4e-3}, start_s)
    times = np.rint(rows.channels["device_time_s"] * 1e6).astype(np.int64) % WRAP
    kept = {int(times[3]): 1.2e-3, int(times[5]): 1.2e-3}
    result = lateness(rows, Stalls(), kept)
    assert (result.late, result.device, result.own) == (2, 1, 1), "of the other, 2.8 ms are not"


def test_the_firmwares_log_is_read(tmp_path: Path) -> None:
    (tmp_path / "late").write_text("4294967295 250\n12 31000\n")
    assert written_late(tmp_path / "late") == {4294967295: 250e-6, 12: pytest.approx(31e-3)}


def test_simultaneous_stalls_of_several_processors_count_once() -> None:
    # 1.000 to 1.010 and 1.005 to 1.012, each with 2 ms after it: 14 ms; then another 3.
    seen = [(1.0, 1.01), (1.005, 1.012), (2.0, 2.001)]
    assert Stalls(seen).together_s == pytest.approx(0.014 + 0.003)


def test_detected_stalls_have_a_positive_length() -> None:
    with host_stalls() as stalls:
        time.sleep(0.2)
    assert all(a + 0.6e-3 < b for a, b in stalls.seen)
