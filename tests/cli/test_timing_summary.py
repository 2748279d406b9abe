"""How punctual the loop was is said in words, and what would mend it where it was not."""

from __future__ import annotations

from dataclasses import asdict, replace

from heli3dof.cli.timing_summary import punctuality_note, punctuality_rows, realtime_advice
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
HELD_UP = replace(OUTCOME, left_out=7)


def test_a_flights_end_says_late_missed_and_lost() -> None:
    assert punctuality_note(OUTCOME) == (
        "late by more than 1 ms: 5 of 1000 periods; 30 missed by this computer, "
        "2 lost on the line; lateness median 2 µs, 99.9 % 0.40 ms, at most 31.20 ms"
    )


def test_samples_that_the_device_skipped_are_not_counted_as_lost() -> None:
    said = "30 missed by this computer, 2 lost on the line, 7 skipped by the device"
    assert said in punctuality_note(HELD_UP)
    about = {"lateness": None, "samples": 9, "outcome_details": HELD_UP.details()}
    assert dict(punctuality_rows(about))["skipped"] == said


def test_a_flight_on_a_virtual_clock_says_nothing_of_it() -> None:
    virtual = replace(OUTCOME, late=0, missed=0, lost=0, punctuality=None, realtime=None)
    assert punctuality_note(virtual) == "late by more than 1 ms: 0 of 1000 periods"
    assert realtime_advice(virtual) is None


def test_what_would_have_helped_is_said_only_to_a_loop_that_was_late() -> None:
    assert realtime_advice(OUTCOME) == (
        "Some periods were late, and real-time scheduling was not granted. Try: sudo this"
    )
    assert realtime_advice(replace(OUTCOME, late=0, missed=0)) is None
    assert realtime_advice(replace(OUTCOME, realtime=GRANTED)) is None


def test_info_shows_what_the_recording_keeps() -> None:
    about = {
        "lateness": {"median_s": 2e-6, "p999_s": 4e-4, "max_s": 31.2e-3, "late_ticks": 5},
        "samples": 1000,
        "outcome_details": {**OUTCOME.details(), "punctuality": asdict(FOUND)},
    }
    rows = dict(punctuality_rows(about))
    assert rows["late by over 1 ms"] == "5 of 1000 periods"
    assert rows["skipped"] == "30 missed by this computer, 2 lost on the line"
    assert rows["sample to command"] == "median 24 µs, 99.9 % 0.18 ms, at most 0.21 ms"
    assert rows["real time"] == "scheduled no, memory locked no"


def test_a_log_without_lateness_has_no_such_rows() -> None:
    assert punctuality_rows({"lateness": None, "samples": 9, "outcome_details": {}}) == []


LATENCY = EchoLatency(5469, 5468, 0, 5.7e-3, 5.9e-3, 7.8e-3, 3, 3, 4)


def test_command_to_echo_latency_is_shown_in_ms_and_periods_at_the_end_and_in_info() -> None:
    shown = "median 5.70 ms (3 periods), 99.9 % 5.90 ms (3 periods), at most 7.80 ms (4 periods)"
    unacknowledged = "5468 of 5469 commands not echoed by the next sample, 0 never"
    slow = replace(OUTCOME, latency=LATENCY)
    assert f"command to echo {shown}; {unacknowledged}" in punctuality_note(slow)
    about = {"lateness": None, "samples": 9, "outcome_details": slow.details()}
    rows = dict(punctuality_rows(about))
    assert rows["command to echo"] == shown
    assert rows["unacknowledged"] == unacknowledged
