"""The timing of the control loop in words, and the advice for a late one."""

from __future__ import annotations

from dataclasses import asdict, replace

from heli3dof.cli.timing_summary import realtime_advice, timing_note, timing_rows
from heli3dof.experiment.control_loop.echo_latency import EchoLatency
from heli3dof.experiment.control_loop.outcome import Outcome, Punctuality
from heli3dof.experiment.control_loop.realtime_priority import Realtime
from heli3dof.rig.interface import Check

FOUND = Punctuality(2e-6, 1e-5, 4e-4, 31.2e-3, 0.01, 24e-6, 1.8e-4, 2.1e-4)
REFUSED = Realtime(
    (Check("real-time scheduling", "not granted", False, "sudo this"),), False, False
)
GRANTED = Realtime((Check("real-time scheduling", "SCHED_FIFO", True),), True, True)
OUTCOME = Outcome("completed", "flown", 1000, 5, 30, 31.2e-3, True, None, 2, FOUND, REFUSED)
HELD_UP = replace(OUTCOME, device_skipped=7)


def test_the_note_counts_late_missed_and_lost_periods() -> None:
    counts = (
        "late by more than 1 ms: 5 of 2500 periods; "
        "skipped: 30 (sample late), 2 (sample lost on the line)"
    )
    assert timing_note(OUTCOME, 2500) == counts
    assert timing_note(replace(OUTCOME, latency=LATENCY), 2500) == counts


def test_periods_that_the_device_skipped_are_counted_apart() -> None:
    result = "30 (sample late), 2 (sample lost on the line), 7 (no sample taken by the device)"
    assert result in timing_note(HELD_UP, 2500)
    about = {"lateness": None, "samples": 9, "outcome_details": HELD_UP.details()}
    assert dict(timing_rows(about))["skipped"] == result


def test_a_flight_on_a_virtual_clock_has_no_lateness() -> None:
    virtual = replace(OUTCOME, late=0, missed=0, lost=0, punctuality=None, realtime=None)
    assert timing_note(virtual, 2500) == "late by more than 1 ms: 0 of 2500 periods"
    assert realtime_advice(virtual) is None


def test_advice_is_given_only_to_a_late_loop() -> None:
    assert realtime_advice(OUTCOME) == (
        "Some periods were late, and real-time scheduling was not granted. Try: sudo this"
    )
    assert realtime_advice(replace(OUTCOME, late=0, missed=0)) is None
    assert realtime_advice(replace(OUTCOME, realtime=GRANTED)) is None


def test_info_shows_the_timing_of_a_recording() -> None:
    about = {
        "lateness": {"median_s": 2e-6, "p999_s": 4e-4, "max_s": 31.2e-3, "late_ticks": 5},
        "samples": 1000,
        "outcome_details": {**OUTCOME.details(), "punctuality": asdict(FOUND)},
    }
    rows = dict(timing_rows(about))
    assert rows["late by over 1 ms"] == "5 of 1000 periods"
    assert rows["skipped"] == "30 (sample late), 2 (sample lost on the line)"
    assert rows["sample to command"] == "median 24 µs, 99.9 % 0.18 ms, maximum 0.21 ms"
    assert rows["real time"] == "scheduled no, memory locked no"


def test_a_log_has_no_timing_rows() -> None:
    assert timing_rows({"lateness": None, "samples": 9, "outcome_details": {}}) == []


LATENCY = EchoLatency(5469, 5468, 0, 5.7e-3, 5.9e-3, 7.8e-3, 3, 3, 4)


def test_latency_is_shown_in_ms_and_periods() -> None:
    shown = "median 5.70 ms (3 periods), 99.9 % 5.90 ms (3 periods), maximum 7.80 ms (4 periods)"
    unacknowledged = "5468 of 5469 commands not echoed by the next sample, 0 never echoed"
    slow = replace(OUTCOME, latency=LATENCY)
    about = {"lateness": None, "samples": 9, "outcome_details": slow.details()}
    rows = dict(timing_rows(about))
    assert rows["command to echo"] == shown
    assert rows["unacknowledged"] == unacknowledged
