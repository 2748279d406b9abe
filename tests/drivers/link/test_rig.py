"""The host's side of the link against the emulated device, in one process and real time."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import pytest
from heli3dof_drivers.emulator.amplifier import FAULT
from heli3dof_drivers.link.frames import (
    Ack,
    Arm,
    Cause,
    CommandFrame,
    Estop,
    Poll,
    SampleFrame,
    parse,
    wire,
)
from heli3dof_drivers.link.rig import LinkRig, stop_over
from heli3dof_drivers.link.sample_validation import cause_name

from heli3dof.errors import DeviceError
from heli3dof.rig.interface import Command, Flags, Sample
from heli3dof.rig.profile import default_profile
from tests.drivers.emulator.still import still_endpoint
from tests.drivers.link.lines import DirectLine

pytestmark = pytest.mark.usefixtures("own_clock")
PROFILE = default_profile()
MODES = pytest.mark.parametrize("stream", [True, False], ids=["stream", "poll"])


def open_direct(*, stream: bool = True, **options) -> tuple[LinkRig, DirectLine]:
    line = DirectLine(still_endpoint())
    return LinkRig(line, PROFILE, driver="test", stream=stream, watchdog_s=0.4, **options), line


def send(rig: LinkRig, k: int, volts: float = 5.0) -> Sample:
    return rig.exchange(Command(k, volts, -volts), time.monotonic() + PROFILE.dt)


def heard(rig: LinkRig, k: int, volts: float = 5.0) -> Sample:
    """The sample that echoes k. Sent again where a busy machine let a sample slip in before it."""
    for _ in range(10):
        if (sample := send(rig, k, volts)).sequence == k:
            return sample
    raise AssertionError(f"command {k} was never carried out")


class Dropping:
    """Loses the next ``n`` frames of a type."""

    def __init__(self, kind: type, n: int) -> None:
        self.kind, self.n = kind, n
        self.dropped = 0

    def __call__(self, data: bytes) -> bytes:
        kept = b""
        for piece in data.split(b"\0")[:-1]:
            if isinstance(parse(piece), self.kind) and self.dropped < self.n:
                self.dropped += 1
            else:
                kept += piece + b"\0"
        return kept


@MODES
def test_it_arms_flies_and_closes(stream: bool):
    rig, line = open_direct(stream=stream)
    assert (rig.identity.serial, rig.identity.boot) == ("G1", 1)
    assert rig.read().flags == Flags(0)
    assert rig.arm().flags == Flags.ENABLED
    for k in range(1, 50):
        sample = heard(rig, k)
        assert sample.v_applied == (5.0, -5.0)
    rig.close()
    assert line.closed
    assert line.endpoint.amplifier.flags == 0


def test_who_never_armed_a_rig_leaves_it_to_whoever_flies_it():
    flying, line = open_direct()
    flying.arm()
    heard(flying, 1)
    other = DirectLine(line.endpoint)
    LinkRig(other, PROFILE, driver="test").close()
    assert other.closed
    assert line.endpoint.amplifier.flags == Flags.ENABLED


def test_a_command_that_the_line_lost_is_counted_and_the_volts_before_it_stand():
    rig, line = open_direct()
    rig.arm()
    heard(rig, 1, 3.0)
    unheard = rig.statistics.commands_unacknowledged
    line.to_device = Dropping(CommandFrame, 1)
    sample = send(rig, 2, 4.0)
    assert (sample.sequence, sample.v_applied) == (1, (3.0, -3.0))
    assert rig.statistics.commands_unacknowledged == unheard + 1
    assert heard(rig, 3, 4.0).v_applied == (4.0, -4.0)


def test_a_sample_that_the_line_lost_is_counted_and_the_next_one_taken():
    rig, line = open_direct()
    rig.arm()
    before = send(rig, 1)
    line.to_host = Dropping(SampleFrame, 3)
    after = send(rig, 2)
    assert after.sequence == 2
    assert after.device_time_s - before.device_time_s >= 4 * PROFILE.dt - 1e-6
    assert rig.statistics.lost == 3


def test_of_samples_that_waited_none_is_returned_and_all_are_counted():
    rig, line = open_direct()
    rig.arm()
    before = heard(rig, 1)
    time.sleep(10 * PROFILE.dt)
    asked_us = line.now_us
    sample = send(rig, 2)
    assert sample.device_time_s > asked_us * 1e-6 - PROFILE.dt
    assert sample.device_time_s - before.device_time_s > 9 * PROFILE.dt
    assert rig.statistics.passed_over >= 9
    assert rig.statistics.lost == 0


def test_a_poll_that_the_line_lost_is_repeated():
    rig, line = open_direct(stream=False)
    rig.arm()
    line.to_device = Dropping(Poll, 2)
    heard(rig, 1)
    assert rig.statistics.repeats >= 2


def test_a_slow_line_is_not_taken_for_one_that_loses_questions():
    rig, line = open_direct(stream=False)
    line.latency_s = 16e-3
    rig.arm()
    for k in range(1, 11):
        heard(rig, k)
    for _ in range(5):
        rig.read()
    assert rig.statistics.repeats == 0
    assert rig.statistics.round_trip.quantile_s(0.5) >= 16e-3


def test_an_answer_that_comes_after_its_question_was_repeated_puts_no_exchange_behind():
    rig, line = open_direct(stream=False)
    rig.arm()
    heard(rig, 1)
    line.latency_s = 16e-3
    send(rig, 2)
    for k in range(3, 13):
        assert send(rig, k).sequence == k
    assert rig.statistics.passed_over > 0


@MODES
@pytest.mark.parametrize("lost", [Arm, Ack])
def test_arming_survives_a_lost_question_and_a_lost_answer(stream: bool, lost: type):
    rig, line = open_direct(stream=stream)
    drop = Dropping(lost, 1)
    line.to_device = line.to_host = drop
    assert rig.arm().flags == Flags.ENABLED
    assert drop.dropped == 1
    heard(rig, 1)


@MODES
def test_a_rig_whose_bytes_end_has_gone_silent(stream: bool):
    rig, line = open_direct(stream=stream)
    rig.arm()
    line.to_host = lambda data: b""
    with pytest.raises(DeviceError, match="gone silent") as caught:
        send(rig, 1)
    assert caught.value.fix
    with pytest.raises(DeviceError, match="not acknowledged"):
        rig.estop("test")
    rig.close()


@MODES
def test_a_device_that_restarted_is_told_from_silence(stream: bool):
    rig, line = open_direct(stream=stream)
    rig.arm()
    send(rig, 1)
    line.endpoint = still_endpoint(boot=2)
    with pytest.raises(DeviceError, match="has restarted"):
        send(rig, 2)


@MODES
def test_a_restart_is_noticed_though_the_boot_number_repeats(stream: bool):
    line = DirectLine(still_endpoint())
    time.sleep(5)
    rig = LinkRig(line, PROFILE, driver="test", stream=stream, watchdog_s=0.4)
    assert rig.identity.started_s == pytest.approx(time.time() - 5, abs=0.5)
    line.restart(still_endpoint())
    with pytest.raises(DeviceError, match="has restarted"):
        rig.arm()
    assert not line.endpoint.amplifier.enabled


@MODES
def test_a_device_that_ran_on_is_not_taken_for_a_restarted_one(stream: bool):
    line = DirectLine(still_endpoint())
    time.sleep(5)
    rig = LinkRig(line, PROFILE, driver="test", stream=stream, watchdog_s=0.4)
    time.sleep(600)
    rig.arm()
    heard(rig, 1)


def test_a_device_that_restarted_before_it_was_armed_is_not_armed():
    rig, line = open_direct()
    line.endpoint = still_endpoint(boot=2)
    with pytest.raises(DeviceError, match="has restarted"):
        rig.arm()
    assert not line.endpoint.amplifier.enabled


@MODES
def test_a_device_that_someone_else_disarmed_is_no_longer_ours(stream: bool):
    rig, line = open_direct(stream=stream)
    rig.arm()
    line.endpoint.amplifier.disarm(line.now_us)
    line.endpoint._period_us = 0
    with pytest.raises(DeviceError, match="another program"):
        send(rig, 1)


def test_a_stopped_stream_that_ended_by_itself_still_says_why():
    rig, line = open_direct()
    rig.arm()
    line.endpoint.stop(line.now_us, Cause.BUTTON)
    line.endpoint._period_us = 0
    assert send(rig, 1).flags == Flags.ESTOP


@MODES
def test_an_emergency_stop_is_repeated_until_the_device_acknowledges_it(stream: bool):
    rig, line = open_direct(stream=stream)
    rig.arm()
    line.to_device = Dropping(Estop, 3)
    rig.estop("test")
    assert line.endpoint.amplifier.flags == Flags.ESTOP
    assert send(rig, 1).flags == Flags.ESTOP


def test_a_stop_over_another_connection_is_seen_by_the_flight():
    rig, line = open_direct()
    rig.arm()
    assert "says so" in stop_over(line)
    sample = send(rig, 1)
    assert sample.flags == Flags.ESTOP
    assert sample.v_applied == (0.0, 0.0)


def test_a_stop_whose_answer_somebody_else_reads_is_confirmed_by_a_sample():
    _, line = open_direct()
    beside = DirectLine(line.endpoint)
    line.endpoint.receive(0, wire(Arm(0, line.endpoint.amplifier.ticket, 2000, 0)))
    beside.to_host = Dropping(Ack, 1000)
    assert "says so" in stop_over(beside, beside=True)
    assert line.endpoint.amplifier.flags == Flags.ESTOP


def test_a_stop_that_nothing_confirms_is_an_error():
    _, line = open_direct()
    line.to_host = lambda data: b""
    with pytest.raises(DeviceError, match="not acknowledged") as caught:
        stop_over(line, beside=True)
    assert "holds the port" in caught.value.cause


def test_a_device_with_a_fault_does_not_arm_and_says_which():
    rig, line = open_direct()
    line.endpoint.amplifier.faulty = True
    line.endpoint.stop(line.now_us, Cause.OVERTEMPERATURE, FAULT)
    with pytest.raises(DeviceError, match="overtemperature"):
        rig.arm()


def test_an_impossible_watchdog_is_refused_by_name():
    line = DirectLine(still_endpoint())
    rig = LinkRig(line, PROFILE, driver="test", watchdog_s=1.5)
    with pytest.raises(DeviceError, match="watchdog of 1500000 µs"):
        rig.arm()


def test_a_watchdog_shorter_than_three_periods_is_lengthened():
    rig = LinkRig(DirectLine(still_endpoint()), PROFILE, driver="test", watchdog_s=1e-3)
    assert rig.identity.watchdog_s == pytest.approx(3 * PROFILE.dt)


@MODES
def test_a_voltage_that_is_not_a_number_stops_the_device(stream: bool):
    rig, line = open_direct(stream=stream)
    rig.arm()
    send(rig, 1)
    with pytest.raises(DeviceError, match="not a voltage"):
        send(rig, 2, math.nan)
    assert line.endpoint.amplifier.flags == Flags.ESTOP


def test_a_cable_that_is_out_is_no_obstacle_to_closing():
    rig, line = open_direct()
    rig.arm()
    line.cut = True
    rig.close()
    rig.close()
    assert line.closed


@MODES
def test_repeated_and_invented_samples_are_rejected(stream: bool):
    rig, line = open_direct(stream=stream)
    rig.arm()
    send(rig, 1)
    said: list[bytes] = []

    def meddle(data: bytes) -> bytes:
        out = b""
        for piece in data.split(b"\0")[:-1]:
            frame = parse(piece)
            out += piece + b"\0"
            if isinstance(frame, SampleFrame):
                said.append(piece)
                out += piece + b"\0"  # twice
                out += wire(replace(frame, number=frame.number + 1, echo=77))  # never sent
        return out

    line.to_host = meddle
    for k in range(2, 6):
        heard(rig, k)
    assert rig.statistics.rejected >= 2 * 4
    assert rig.statistics.lost == 0


def test_the_device_tells_how_the_link_was():
    rig, _ = open_direct()
    report = rig.report()
    assert report is not None
    assert report.frames == 3  # HELLO, STATUS of the opening, STATUS
    assert report.damaged == 0


@MODES
@pytest.mark.parametrize("cause", [Cause.OVERCURRENT, Cause.BUTTON, Cause.SUPPLY])
def test_the_devices_own_cause_is_at_hand_until_it_is_armed(stream: bool, cause: Cause):
    rig, line = open_direct(stream=stream)
    rig.arm()
    heard(rig, 1)
    assert rig.device_cause is None
    line.endpoint.stop(line.now_us, cause)
    assert send(rig, 2).flags == Flags.ESTOP
    assert rig.device_cause == cause.name
    rig.arm()
    assert rig.device_cause is None


def test_a_cause_that_this_heli3dof_does_not_know_is_passed_on_by_number():
    assert cause_name(77) == "CAUSE_77"
    assert cause_name(0) is None
