"""The first signal ramps to zero, the second stops at once, later ones are ignored."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable

import pytest

from heli3dof.experiment.control_loop.loop import fly
from heli3dof.experiment.control_loop.outcome import Outcome
from heli3dof.experiment.control_loop.signal_handling import stop_signals
from heli3dof.experiment.plan import step_plan
from heli3dof.recording.memory import MemoryRecorder
from heli3dof.rig.interface import Sample
from tests.experiment.control_loop.test_loop import DT, PROFILE, ScriptedRig, ends_at_zero


def send(number: signal.Signals) -> None:
    os.kill(os.getpid(), number)


def flown_with_signals(at: dict[int, tuple[signal.Signals, ...]]) -> tuple[ScriptedRig, Outcome]:
    """A flight during which these signals come, by the number of the exchange."""

    def script(k: int, sample: Sample) -> Sample:
        for number in at.get(k, ()):
            send(number)
        return sample

    rig, sink = ScriptedRig(script), MemoryRecorder()
    plan = step_plan((0.0, None, None), settle_s=0, duration_s=100 * DT)
    with stop_signals() as received:
        outcome = fly(
            rig, PROFILE, plan.render(DT, 0), sink, stop=received.reason, at_once=received.at_once
        )
    return rig, outcome


@pytest.mark.parametrize(
    ("number", "message"),
    [
        (signal.SIGINT, "stopped with Ctrl-C"),
        (signal.SIGTERM, "stopped by a request to terminate (SIGTERM)"),
        (signal.SIGHUP, "stopped because the terminal was closed (SIGHUP)"),
    ],
)
def test_one_signal_ends_the_flight_with_a_ramp_to_zero(
    number: signal.Signals, message: str
) -> None:
    before = signal.signal(number, signal.default_int_handler)  # ignored under nohup
    try:
        rig, outcome = flown_with_signals({20: (number,)})
    finally:
        signal.signal(number, before)
    assert (outcome.ending, outcome.detail, outcome.periods) == ("interrupted", message, 20)
    assert outcome.landed
    assert ends_at_zero(rig)
    assert not rig.stopped


def test_a_second_ctrl_c_stops_the_rig_at_once() -> None:
    rig, outcome = flown_with_signals({20: (signal.SIGINT,), 30: (signal.SIGINT,)})
    assert outcome.ending == "tripped"
    assert outcome.detail == "stopped with Ctrl-C; emergency stop, by a second Ctrl-C"
    assert not outcome.landed
    assert len(rig.commands) == 30, "no command after it"
    assert rig.stopped == ["emergency stop, by a second Ctrl-C"]


def test_two_signals_between_two_periods_stop_without_a_ramp() -> None:
    rig, outcome = flown_with_signals({20: (signal.SIGINT, signal.SIGTERM)})
    assert outcome.detail == "stopped with Ctrl-C; emergency stop, by a second SIGTERM"
    assert len(rig.commands) == 20
    assert rig.stopped


def test_the_handlers_are_restored() -> None:
    before = [signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)]
    with stop_signals() as received:
        assert (received.reason(), received.at_once()) == (None, None)
    assert [signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)] == before


def test_under_nohup_the_flight_goes_on_when_the_terminal_closes() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with stop_signals() as received:
            send(signal.SIGHUP)
            assert received.reason() is None
    finally:
        signal.signal(signal.SIGHUP, before)


def test_outside_the_main_thread_no_signal_is_caught() -> None:
    reasons: list[Callable] = []

    def elsewhere() -> None:
        with stop_signals() as received:
            reasons.append(received.reason)

    thread = threading.Thread(target=elsewhere)
    thread.start()
    thread.join()
    assert reasons[0]() is None
