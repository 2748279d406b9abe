"""The emulated device's replies and voltages are those of docs/reference/protocol.md."""

from __future__ import annotations

import statistics
from itertools import groupby, pairwise

import pytest
from cobs.cobs import encode
from heli3dof_drivers.emulator.amplifier import FAULT, Amplifier
from heli3dof_drivers.emulator.endpoint import Endpoint
from heli3dof_drivers.emulator.transport_pty import emulated
from heli3dof_drivers.link.frames import (
    Ack,
    Arm,
    Cause,
    Code,
    CommandFrame,
    Disarm,
    Estop,
    Frame,
    Hello,
    IdentityFrame,
    Poll,
    Report,
    SampleFrame,
    Splitter,
    Status,
    check,
    wire,
)
from hypothesis import given
from hypothesis import strategies as st

from tests.drivers.emulator.still import StillDevice, still_endpoint
from tests.drivers.link.golden_transcripts import TRANSCRIPTS, Line

V5 = 5_000_000


def frames(data: bytes) -> list[Frame]:
    return Splitter().feed(data)


def send(endpoint: Endpoint, now_us: int, *sent: Frame) -> list[Frame]:
    return frames(endpoint.receive(now_us, b"".join(map(wire, sent))))


@pytest.mark.parametrize("name", TRANSCRIPTS)
def test_it_replies_as_in_the_golden_transcripts(name: str):
    endpoint = still_endpoint()
    for time_us, turn in groupby(TRANSCRIPTS[name], key=lambda line: line.time_us):
        lines = list(turn)
        request = b"".join(line.bytes for line in lines if line.sender == "host")
        expected = b"".join(line.bytes for line in lines if line.sender == "device")
        if any(line.sender == "clock" for line in lines):
            endpoint.held_up(time_us)
        answered = endpoint.tick(time_us)
        if request:
            answered += endpoint.receive(time_us, request)
        assert answered == expected, explain(lines, answered)


def explain(lines: list[Line], answered: bytes) -> str:
    return f"{lines}\nanswered {frames(answered)}"


@pytest.mark.parametrize("name", TRANSCRIPTS)
def test_a_rarely_called_device_sends_the_same_bytes(name: str):
    endpoint = still_endpoint()
    answered = expected = b""
    for line in TRANSCRIPTS[name]:
        if line.sender == "host":
            answered += endpoint.receive(line.time_us, line.bytes)
        elif line.sender == "clock":
            endpoint.held_up(line.time_us)
        else:
            expected += line.bytes
    assert answered == expected


def test_an_unknown_type_is_refused_with_a_reply():
    endpoint = still_endpoint()
    data = bytes([1, 0x55, 9, 0, 0, 0, 1, 2, 3])
    replies = frames(endpoint.receive(100, encode(data + check(data)) + b"\0"))
    assert replies == [Ack(9, 0x55, Code.UNKNOWN_TYPE, 0, 0, 1)]
    # A device's own frame: the line echoes.
    assert send(endpoint, 200, Ack(4, 1, 0, 0, 0, 0)) == []
    report = send(endpoint, 300, Status(5))[0]
    assert isinstance(report, Report)
    assert (report.frames, report.refused, report.malformed) == (3, 2, 0)


def test_a_stream_ends_two_seconds_after_the_hosts_last_frame():
    endpoint = still_endpoint()
    send(endpoint, 0, Arm(0, 1, 2000, 0))
    replies = frames(endpoint.tick(10_000_000))
    assert len(replies) == 1000
    assert replies[-1].time_us == 2_000_000  # type: ignore[union-attr]
    assert endpoint.next_us() is None
    assert send(endpoint, 10_000_001, Poll(1))[0].flags == 8  # type: ignore[union-attr]


def test_a_stream_refuses_polls_and_keeps_its_own_clock():
    endpoint = still_endpoint()
    send(endpoint, 1000, Arm(0, 1, 2000, 0))
    samples = send(endpoint, 9999, Poll(1))
    assert [f.time_us for f in samples] == [3000, 5000, 7000, 9000]  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("period_us", "watchdog_us", "code"),
    [
        (499, 0, Code.BAD_PARAMETER),
        (500, 999, Code.BAD_PARAMETER),
        (500, 1000, Code.OK),
        (60_000, 0, Code.BAD_PARAMETER),
        (0, 1_000_001, Code.BAD_PARAMETER),
        (0, 1_000_000, Code.OK),
    ],
)
def test_periods_and_watchdogs_out_of_range_are_refused(
    period_us: int, watchdog_us: int, code: Code
):
    answer = send(still_endpoint(), 0, Arm(0, 1, period_us, watchdog_us))[0]
    assert isinstance(answer, Ack)
    assert answer.code == code


def test_every_change_of_state_changes_the_ticket():
    endpoint = still_endpoint()
    tickets = [endpoint.amplifier.ticket]

    def after(now_us: int, *sent: Frame) -> None:
        send(endpoint, now_us, *sent)
        tickets.append(endpoint.amplifier.ticket)

    after(0, Arm(0, 1, 0, 0))
    after(200_000)  # latched
    after(200_100, Disarm(1))
    after(200_200, Arm(2, endpoint.amplifier.ticket, 0, 0))
    after(200_300, Estop(3))
    assert all(a != b for a, b in pairwise(tickets))


def test_a_fault_stops_the_device_and_prevents_arming():
    endpoint = still_endpoint()
    send(endpoint, 0, Arm(0, 1, 0, 0), CommandFrame(1, V5, V5))
    endpoint.amplifier.faulty = True
    endpoint.stop(1000, Cause.OVERCURRENT, FAULT)
    sample = send(endpoint, 1100, Poll(2))[0]
    assert isinstance(sample, SampleFrame)
    assert (sample.front_uV, sample.flags, sample.cause) == (0, FAULT, Cause.OVERCURRENT)
    answer = send(endpoint, 1200, Arm(3, endpoint.amplifier.ticket, 0, 0))[0]
    assert isinstance(answer, Ack)
    assert answer.code == Code.FAULT


def test_the_plant_gets_the_mean_voltage_of_each_period():
    device = StillDevice()
    endpoint = Endpoint(device)  # type: ignore[arg-type]
    send(endpoint, 1000, Arm(0, 1, 2000, 100_000))
    send(endpoint, 1500, CommandFrame(1, 4_000_000, -4_000_000))
    send(endpoint, 4000, CommandFrame(2, 8_000_000, 0))
    endpoint.tick(7000)
    assert device.plant.volts[-3:] == [(3.0, -3.0), (6.0, -2.0), (8.0, 0.0)]
    # Expired at 104 ms; the ramp is straight, so its mean over 103…105 ms is that of two pieces.
    endpoint.tick(105_000)
    half_way_down = 8.0 * (1 - 0.5e-3 / 0.2)
    assert device.plant.volts[-1][0] == pytest.approx((8.0 + half_way_down) / 2, abs=1e-6)
    endpoint.tick(400_000)
    assert device.plant.volts[-1] == (0.0, 0.0)


@given(
    st.integers(-(2**31), 2**31 - 1),
    st.lists(st.integers(1, 40_000), min_size=1, max_size=40),
)
def test_the_ramp_never_rises_and_ends_at_zero(uV: int, steps: list[int]):
    amplifier = Amplifier(24_000_000, 100_000)
    amplifier.arm(0, 0, 100_000)
    amplifier.command(0, 1, uV, 0)
    now, last = 0, abs(amplifier.output_uV(0)[0])
    assert last <= 24_000_000
    for step in steps:
        now += step
        out = abs(amplifier.output_uV(now)[0])
        assert out <= last
        last = out
        assert out == 0 or now < 300_000
        assert amplifier.enabled == (now <= 100_000)


@given(st.integers(0, 2**32 - 1), st.integers(0, 2**32 - 1))
def test_a_command_is_accepted_exactly_when_it_is_newer(last: int, number: int):
    amplifier = Amplifier(24_000_000, 100_000)
    amplifier.arm(0, last, 100_000)
    newer = 0 < (number - last) % 2**32 < 2**31
    assert amplifier.command(1, number, 1, 1) == newer
    assert amplifier.output_uV(1) == ((1, 1) if newer else (0, 0))


@given(st.lists(st.binary(max_size=40), max_size=20))
def test_noise_causes_no_voltage(noise: list[bytes]):
    endpoint = still_endpoint()
    for k, data in enumerate(noise):
        endpoint.receive(100 * k, data)
    assert endpoint.amplifier.flags == 0
    assert endpoint.amplifier.output_uV(10_000) == (0, 0)


def test_the_emulated_rig_of_a_url_moves_like_the_mock():
    endpoint = emulated("mock:?seed=3")
    identity = send(endpoint, 0, Hello(1))[0]
    assert isinstance(identity, IdentityFrame)
    assert identity.serial.rstrip(b"\0") == b"mock-3"
    assert identity.model.startswith(b"emulated")
    send(endpoint, 0, Arm(0, identity.ticket, 2000, 0))
    for k in range(1, 251):
        replies = send(endpoint, 2000 * k, CommandFrame(k, 12_000_000, 11_500_000))
    sample = replies[-1]
    assert isinstance(sample, SampleFrame)
    assert sample.roll > 0
    assert sample.pitch > 0
    assert sample.front_mA > 0


def test_a_lost_sample_keeps_its_number():
    endpoint = emulated("mock:?hide=timing.gaps:0.3")
    send(endpoint, 0, Arm(0, 1, 2000, 1_000_000))
    numbers = [f.number for f in frames(endpoint.tick(800_000))]
    gaps = sum(b - a - 1 for a, b in pairwise(numbers))
    assert numbers == sorted(set(numbers))
    assert 60 < gaps < 180


def test_jitter_is_in_the_devices_time_stamps():
    endpoint = emulated("mock:?hide=timing.jitter:0.0002&seed=2")
    send(endpoint, 0, Arm(0, 1, 2000, 1_000_000))
    times = [f.time_us for f in frames(endpoint.tick(1_000_000))]  # type: ignore[union-attr]
    off = [t - 2000 * k for k, t in enumerate(times, 1)]
    assert 150 < statistics.pstdev(off) < 250
    assert all(a < b for a, b in pairwise(times))
