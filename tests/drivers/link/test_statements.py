"""Statements of docs/reference/protocol.md without a transcript, for both devices."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from cobs.cobs import encode
from heli3dof_drivers.link.frames import (
    Ack,
    Arm,
    Cause,
    Code,
    CommandFrame,
    Disarm,
    Estop,
    Frame,
    Poll,
    Report,
    SampleFrame,
    Splitter,
    Status,
    Type,
    check,
    wire,
)

from tests.drivers.emulator.still import still_endpoint
from tests.drivers.firmware.building import run

Script = list[tuple[int, Frame | bytes]]
Device = Callable[[Script], list[Frame]]
V5 = 5_000_000


def python_device(script: Script) -> list[Frame]:
    device = still_endpoint()
    out = b""
    for now, sent in script:
        out += device.receive(now, sent if isinstance(sent, bytes) else wire(sent))
    return Splitter().feed(out)


def c_device(script: Script) -> list[Frame]:
    text = "".join(
        f"{now} > {(sent if isinstance(sent, bytes) else wire(sent)).hex()}\n"
        for now, sent in script
    )
    answers = "".join(line.split(" < ")[1] for line in run("heli3dof-replay", text=text))
    return Splitter().feed(bytes.fromhex(answers))


BOTH = pytest.mark.parametrize("device", [python_device, c_device], ids=["python", "c"])


def samples(frames: list[Frame]) -> list[SampleFrame]:
    return [f for f in frames if isinstance(f, SampleFrame)]


def acks(frames: list[Frame]) -> list[Ack]:
    return [f for f in frames if isinstance(f, Ack)]


@BOTH
def test_the_echo_is_the_arms_number_until_a_command_is_accepted(device: Device):
    replies = device([
        (100, Poll(0)),
        (1000, Arm(40, 1, 0, 0)),
        (1100, CommandFrame(40, V5, V5)),
        (1200, Poll(0)),
        (1300, CommandFrame(43, V5, V5)),
        (1400, CommandFrame(42, V5, V5)),
        (1500, Poll(0)),
        (1600, Estop(0)),
        (1700, CommandFrame(44, V5, V5)),
        (1800, Poll(0)),
    ])  # fmt: skip
    assert [s.echo for s in samples(replies)] == [0, 40, 40, 43, 43]


@BOTH
def test_a_watchdog_of_zero_means_the_devices_own_within_the_same_bounds(device: Device):
    replies = device([
        (1000, Arm(0, 1, 50_001, 0)),
        (1100, Arm(0, 1, 50_000, 0)),
        (101_100, CommandFrame(1, V5, V5)),
        (201_200, Status(5)),
    ])  # fmt: skip
    assert [a.code for a in acks(replies)] == [Code.BAD_PARAMETER, Code.OK]
    report = next(f for f in replies if isinstance(f, Report))
    assert report.expiries == 1


@BOTH
def test_every_disarm_and_every_estop_changes_the_ticket(device: Device):
    replies = device([(100 + k, f) for k, f in enumerate(
        (Disarm(1), Disarm(2), Estop(3), Estop(4), Disarm(5)), start=1
    )])  # fmt: skip
    assert [a.ticket for a in acks(replies)] == [2, 3, 4, 5, 6]


@BOTH
def test_a_refused_request_does_not_change_the_ticket(device: Device):
    replies = device([
        (100, CommandFrame(1, V5, V5)), (200, Arm(1, 9, 0, 0)), (300, Arm(2, 1, 499, 0)),
        (400, Arm(3, 1, 0, 1_000_001)), (500, Status(4)),
    ])  # fmt: skip
    codes = [Code.STALE_TICKET, Code.BAD_PARAMETER, Code.BAD_PARAMETER]
    assert [a.code for a in acks(replies)] == codes
    assert [a.ticket for a in acks(replies)] == [1, 1, 1]


@BOTH
def test_saturated_is_cleared_by_the_next_command_within_the_limit(device: Device):
    replies = device([
        (1000, Arm(0, 1, 0, 0)),
        (1100, CommandFrame(1, 30_000_000, 0)), (1200, Poll(0)),
        (1300, CommandFrame(2, V5, 0)), (1400, Poll(0)),
        (1500, CommandFrame(3, -30_000_000, 0)), (1600, Poll(0)),
        (1700, Estop(0)), (1800, Poll(0)),
    ])  # fmt: skip
    assert [s.flags for s in samples(replies)] == [1, 33, 1, 33, 16]
    assert [s.front_uV for s in samples(replies)] == [0, 24_000_000, V5, -24_000_000, 0]


@BOTH
def test_the_ramp_shows_latched_and_not_enabled_until_zero_volts(device: Device):
    replies = device([
        (1000, Arm(0, 1, 0, 0)), (2000, CommandFrame(1, V5, V5)), (102_000, Poll(0)),
        (102_001, Poll(0)), (202_000, Poll(0)), (202_100, Disarm(9)), (202_200, Poll(0)),
    ])  # fmt: skip
    assert [s.flags for s in samples(replies)] == [1, 1, 8, 8, 8]
    volts = [s.front_uV for s in samples(replies)]
    assert volts[1] == V5
    assert V5 > volts[2] > volts[3] == V5 // 2
    assert volts[4] == 0, "DISARM ends the ramp"
    assert samples(replies)[-1].cause == Cause.WATCHDOG


@BOTH
@pytest.mark.parametrize("reason", [0, 2, 4, 9, 10, 255])
def test_an_estop_is_obeyed_with_any_reason_which_becomes_the_cause(device: Device, reason: int):
    replies = device([(100, Estop(0, reason)), (200, Poll(0))])
    assert (acks(replies)[0].code, acks(replies)[0].cause, acks(replies)[0].flags) == (
        0,
        reason,
        16,
    )
    assert (samples(replies)[0].flags, samples(replies)[0].cause) == (16, reason)


@BOTH
@pytest.mark.parametrize(
    ("kind", "body", "refused", "malformed", "answered"),
    [
        (0x08, b"", 1, 0, True),
        (0x7F, b"any length", 1, 0, True),
        (0x83, b"of another length", 0, 1, False),
        (0x87, b"\1" * 34, 1, 0, False),
        (0xFF, b"", 1, 0, False),
        (Type.POLL, b"too long", 0, 1, False),
        (Type.HELLO, b"", 0, 1, False),
    ],
)
def test_an_unknown_type_is_refused_and_a_wrong_length_is_malformed(
    device: Device, kind: int, body: bytes, refused: int, malformed: int, answered: bool
):
    data = bytes([1, kind, 7, 0, 0, 0]) + body
    piece = encode(data + check(data)) + b"\0"
    replies = device([(100, piece), (200, Status(8))])
    report = next(f for f in replies if isinstance(f, Report))
    assert (report.refused, report.malformed, report.frames) == (refused, malformed, 1 + refused)
    assert bool(acks(replies)) == answered
    assert all(a.code == Code.UNKNOWN_TYPE and a.number == 7 for a in acks(replies))
