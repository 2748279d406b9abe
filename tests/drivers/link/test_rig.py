"""The host's side of the link against the emulated device, in one process and real time."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import pytest
from heli3dof_drivers.emulator.amplifier import FAULT
from heli3dof_drivers.link.emergency_stop import stop_over
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
from heli3dof_drivers.link.rig import LinkRig
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


def echoed(rig: LinkRig, k: int, volts: float = 5.0) -> Sample:
    """The sample that echoes k; the command is repeated where a sample came before it."""
    for _ in range(10):
        if (sample := send(rig, k, volts)).sequence == k:
            return sample
    raise AssertionError(f"command {k} was never applied")


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
        sample = echoed(rig, k)
        assert sample.v_applied == (5.0, -5.0)
    rig.close()
    assert line.closed
    assert line.endpoint.amplifier.flags == 0


def test_closing_a_rig_that_was_not_armed_here_does_not_stop_it():
    flying, line = open_direct()
    flying.arm()
    echoed(flying, 1)
    other = DirectLine(line.endpoint)
    LinkRig(other, PROFILE, driver="test").close()
    assert other.closed
    assert line.endpoint.amplifier.flags == Flags.ENABLED


def test_a_lost_command_is_counted_and_the_last_voltage_is_kept():
    rig, line = open_direct()
    rig.arm()
    echoed(rig, 1, 3.0)
    before = rig.statistics.commands_unacknowledged
    line.to_device = Dropping(CommandFrame, 1)
    sample = send(rig, 2, 4.0)
    assert (sample.sequence, sample.v_applied) == (1, (3.0, -3.0))
    assert rig.statistics.commands_unacknowledged == before + 1
    assert echoed(rig, 3, 4.0).v_applied == (4.0, -4.0)


def test_a_lost_sample_is_counted_and_the_next_one_is_used():
    rig, line = open_direct()
    rig.arm()
    before = send(rig, 1)
    line.to_host = Dropping(SampleFrame, 3)
    after = send(rig, 2)
    assert after.sequence == 2
    assert after.device_time_s - before.device_time_s >= 4 * PROFILE.dt - 1e-6
    assert rig.statistics.lost == 3


def test_samples_that_waited_are_discarded_and_counted_as_stale():
    rig, line = open_direct()
    rig.arm()
    before = echoed(rig, 1)
    time.sleep(10 * PROFILE.dt)
    asked_us = line.now_us
    sample = send(rig, 2)
    assert sample.device_time_s > asked_us * 1e-6 - PROFILE.dt
    assert sample.device_time_s - before.device_time_s > 9 * PROFILE.dt
    assert rig.statistics.samples_stale >= 9
    assert rig.statistics.lost == 0


def test_a_lost_poll_is_repeated():
    rig, line = open_direct(stream=False)
    rig.arm()
    line.to_device = Dropping(Poll, 2)
    echoed(rig, 1)
    assert rig.statistics.retries >= 2


def test_a_slow_line_causes_no_retries():
    rig, line = open_direct(stream=False)
    line.latency_s = 16e-3
    rig.arm()
    for k in range(1, 11):
        echoed(rig, k)
    for _ in range(5):
        rig.read()
    assert rig.statistics.retries == 0
    assert rig.statistics.round_trip.quantile_s(0.5) >= 16e-3


def test_a_late_reply_to_a_repeated_poll_delays_no_exchange():
    rig, line = open_direct(stream=False)
    rig.arm()
    echoed(rig, 1)
    line.latency_s = 16e-3
    send(rig, 2)
    for k in range(3, 13):
        assert send(rig, k).sequence == k
    assert rig.statistics.samples_stale > 0


@MODES
@pytest.mark.parametrize("lost", [Arm, Ack])
def test_arming_succeeds_after_a_lost_request_or_reply(stream: bool, lost: type):
    rig, line = open_direct(stream=stream)
    drop = Dropping(lost, 1)
    line.to_device = line.to_host = drop
    assert rig.arm().flags == Flags.ENABLED
    assert drop.dropped == 1
    echoed(rig, 1)


@MODES
def test_a_rig_that_sends_nothing_is_an_error(stream: bool):
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
def test_a_rig_that_sends_only_malformed_bytes_is_not_silent(stream: bool):
    rig, line = open_direct(stream=stream)
    rig.arm()
    line.to_host = lambda data: b"\x55" * (len(data) - 1) + b"\0" if data else b""
    with pytest.raises(DeviceError, match=r"no valid frame for .*, but \d+ malformed") as caught:
        send(rig, 1)
    assert "baud rate" in caught.value.cause


@MODES
def test_a_device_that_answers_but_sends_no_samples_is_named(stream: bool):
    rig, line = open_direct(stream=stream)
    rig.arm()
    echoed(rig, 1)
    line.to_host = Dropping(SampleFrame, 10**6)
    with pytest.raises(DeviceError, match="no valid sample") as caught:
        send(rig, 2)
    assert caught.value.cause.startswith("the device answers requests but sends no samples")


@MODES
def test_a_restarted_device_has_its_own_error(stream: bool):
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
def test_a_device_that_kept_running_does_not_count_as_restarted(stream: bool):
    line = DirectLine(still_endpoint())
    time.sleep(5)
    rig = LinkRig(line, PROFILE, driver="test", stream=stream, watchdog_s=0.4)
    time.sleep(600)
    rig.arm()
    echoed(rig, 1)


def test_a_device_that_restarted_before_it_was_armed_is_not_armed():
    rig, line = open_direct()
    line.endpoint = still_endpoint(boot=2)
    with pytest.raises(DeviceError, match="has restarted"):
        rig.arm()
    assert not line.endpoint.amplifier.enabled


@MODES
def test_disarming_by_another_program_ends_the_run(stream: bool):
    rig, line = open_direct(stream=stream)
    rig.arm()
    line.endpoint.amplifier.disarm(line.now_us)
    line.endpoint._period_us = 0
    with pytest.raises(DeviceError, match="another program"):
        send(rig, 1)


@MODES
@pytest.mark.parametrize("damage", ["malformed", "rejected"])
def test_a_device_without_valid_samples_is_not_taken_for_another_programs(
    stream: bool, damage: str
):
    rig, line = open_direct(stream=stream)
    rig.arm()
    echoed(rig, 1)

    def spoil(data: bytes) -> bytes:
        out = b""
        for piece in data.split(b"\0")[:-1]:
            frame = parse(piece)
            if not isinstance(frame, SampleFrame):
                out += piece + b"\0"
            elif damage == "malformed":
                out += piece[:-3] + b"\0"
            else:
                out += wire(replace(frame, echo=77))
        return out

    line.to_host = spoil
    with pytest.raises(
        DeviceError, match=rf"no valid sample for .*\b[1-9][0-9]* {damage}"
    ) as caught:
        send(rig, 2)
    assert "the watchdog stopped the motors" in caught.value.what
    assert "repeats old samples or damages frames" in caught.value.cause


def test_the_flags_of_a_stopped_device_are_read_after_its_stream_ended():
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
    assert "confirmed" in stop_over(line)
    sample = send(rig, 1)
    assert sample.flags == Flags.ESTOP
    assert sample.v_applied == (0.0, 0.0)


def test_a_sample_confirms_a_stop_whose_reply_another_program_read():
    _, line = open_direct()
    other = DirectLine(line.endpoint)
    line.endpoint.receive(0, wire(Arm(0, line.endpoint.amplifier.ticket, 2000, 0)))
    other.to_host = Dropping(Ack, 1000)
    assert "confirmed" in stop_over(other, shared=True)
    assert line.endpoint.amplifier.flags == Flags.ESTOP


def test_a_stop_that_nothing_confirms_is_an_error():
    _, line = open_direct()
    line.to_host = lambda data: b""
    with pytest.raises(DeviceError, match="not acknowledged") as caught:
        stop_over(line, shared=True)
    assert "holds the port" in caught.value.cause


def test_a_device_with_a_fault_does_not_arm_and_names_the_fault():
    rig, line = open_direct()
    line.endpoint.amplifier.faulty = True
    line.endpoint.stop(line.now_us, Cause.OVERTEMPERATURE, FAULT)
    with pytest.raises(DeviceError, match="overtemperature"):
        rig.arm()


def test_a_watchdog_beyond_one_second_is_refused():
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


def test_a_rig_can_be_closed_after_it_was_unplugged():
    rig, line = open_direct()
    rig.arm()
    line.cut = True
    rig.close()
    rig.close()
    assert line.closed


@MODES
def test_repeated_samples_and_false_echoes_are_rejected(stream: bool):
    rig, line = open_direct(stream=stream)
    rig.arm()
    send(rig, 1)

    def tamper(data: bytes) -> bytes:
        out = b""
        for piece in data.split(b"\0")[:-1]:
            frame = parse(piece)
            out += piece + b"\0"
            if isinstance(frame, SampleFrame):
                out += piece + b"\0"  # twice
                out += wire(replace(frame, number=frame.number + 1, echo=77))  # never sent
        return out

    line.to_host = tamper
    for k in range(2, 6):
        echoed(rig, k)
    assert rig.statistics.rejected >= 2 * 4
    assert rig.statistics.lost == 0


def test_the_device_reports_its_counters():
    rig, _ = open_direct()
    report = rig.report()
    assert report is not None
    assert report.frames == 3  # HELLO, STATUS of the opening, STATUS
    assert report.malformed == 0


@MODES
@pytest.mark.parametrize("cause", [Cause.OVERCURRENT, Cause.BUTTON, Cause.SUPPLY])
def test_the_devices_cause_is_available_until_it_is_armed(stream: bool, cause: Cause):
    rig, line = open_direct(stream=stream)
    rig.arm()
    echoed(rig, 1)
    assert rig.device_cause is None
    line.endpoint.stop(line.now_us, cause)
    assert send(rig, 2).flags == Flags.ESTOP
    assert rig.device_cause == cause.name
    rig.arm()
    assert rig.device_cause is None


def test_an_unknown_cause_is_reported_by_its_number():
    assert cause_name(77) == "CAUSE_77"
    assert cause_name(0) is None
