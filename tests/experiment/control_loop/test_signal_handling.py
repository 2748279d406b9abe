"""The first signal ramps to zero, the second stops at once, later ones are ignored."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator

import pytest

from heli3dof.experiment.control_loop.loop import fly
from heli3dof.experiment.control_loop.outcome import Outcome
from heli3dof.experiment.control_loop.signal_handling import (
    end_on_signals,
    ignore_signals,
    stop_signals,
)
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
            rig,
            PROFILE,
            plan.render(DT, 0),
            sink,
            stop=received.reason,
            stop_without_ramp=received.stop_without_ramp,
        )
    return rig, outcome


@pytest.mark.parametrize(
    ("number", "message"),
    [
        (signal.SIGINT, "stopped with Ctrl-C"),
        (signal.SIGTERM, "stopped by a request to terminate (SIGTERM)"),
        (signal.SIGHUP, "stopped because the terminal was closed (SIGHUP)"),
        (signal.SIGQUIT, "stopped with Ctrl-\\ (SIGQUIT)"),
        (signal.SIGUSR1, "stopped by SIGUSR1"),  # a batch system's warning
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
        assert (received.reason(), received.stop_without_ramp()) == (None, None)
    assert [signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)] == before


@pytest.fixture
def as_in_the_command_line() -> Iterator[None]:
    """The signals are handled as in a process that runs one command."""
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = [signal.getsignal(n) for n in numbers]
    end_on_signals()
    yield
    for number, handler in zip(numbers, before, strict=True):
        signal.signal(number, handler)


@pytest.mark.usefixtures("as_in_the_command_line")
def test_without_a_flight_a_signal_interrupts_the_command() -> None:
    with stop_signals():
        pass
    for number, reason in (
        (signal.SIGINT, "stopped with Ctrl-C"),
        (signal.SIGTERM, "stopped by a request to terminate (SIGTERM)"),
    ):
        with pytest.raises(KeyboardInterrupt) as caught:
            send(number)
        assert str(caught.value) == reason


@pytest.mark.usefixtures("as_in_the_command_line")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_after_a_flight_that_a_signal_ended_the_command_ignores_signals(
    number: signal.Signals,
) -> None:
    with stop_signals() as received:
        send(number)
    assert received.reason()
    send(signal.SIGINT)
    send(signal.SIGTERM)


@pytest.mark.usefixtures("as_in_the_command_line")
def test_once_the_exit_code_is_decided_the_command_ignores_signals() -> None:
    ignore_signals()
    send(signal.SIGINT)
    send(signal.SIGTERM)


@pytest.mark.usefixtures("as_in_the_command_line")  # which restores both handlers
def test_a_signal_that_was_ignored_at_the_start_stays_ignored() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_on_signals()
    send(signal.SIGINT)


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
