"""Golden transcripts: the replies of a device of protocol 1, microsecond by microsecond.

Each line has a time in µs on the device's clock, a sender, and a frame or bytes. The golden device
has just started at 0, its encoders do not move, it measures no current, and its ticket counts up
from 1. Every device that receives the host's bytes at these times replies with the device's bytes,
in this order. A line of the clock is an instant until which the device was held up: it did nothing
since the previous line.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from cobs.cobs import encode
from heli3dof_drivers.link.frames import (
    NOT_MEASURED,
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
    Status,
    Type,
    check,
    payload,
    wire,
)

ENABLED, LATCHED, ESTOP, SATURATED = 1, 8, 16, 32
GOLDEN = IdentityFrame(
    0, 1, 0, 1, 1, 4096, 4096, 8192, 24_000_000, 100_000, 200_000, 500,
    b"golden device".ljust(16, b"\0"), b"G1".ljust(16, b"\0"), b"1.0".ljust(16, b"\0"),
)  # fmt: skip
V5 = 5_000_000


@dataclass(frozen=True)
class Line:
    """What one side sends at one time."""

    time_us: int
    sender: Literal["host", "device", "clock"]
    content: Frame | bytes
    note: str = ""

    @property
    def bytes(self) -> bytes:
        return self.content if isinstance(self.content, bytes) else wire(self.content)


def host(time_us: int, content: Frame | bytes, note: str = "") -> Line:
    return Line(time_us, "host", content, note)


def device(time_us: int, content: Frame, note: str = "") -> Line:
    return Line(time_us, "device", content, note)


def held_up(time_us: int, note: str) -> Line:
    return Line(time_us, "clock", b"", note)


def of_version(version: int, frame: Frame) -> bytes:
    """The frame with that version in its header."""
    data = bytes([version]) + payload(frame)[1:-4]
    return bytes(encode(data + check(data))) + b"\0"


def sample(
    number: int, echo: int, time_us: int, uV: int, flags: int, cause: Cause = Cause.NONE,
    delay_us: int = 65535,
) -> SampleFrame:  # fmt: skip
    return SampleFrame(
        number, echo, time_us, 0, 0, 0, uV, -uV, NOT_MEASURED, NOT_MEASURED, delay_us, flags, cause
    )


def volts(number: int, uV: int) -> CommandFrame:
    return CommandFrame(number, uV, -uV)


HELLO = (
    host(100, Hello(7)),
    device(100, replace(GOLDEN, number=7)),
    host(200, Poll(8), "a sample without arming"),
    device(200, sample(0, 0, 200, 0, 0)),
    host(300, volts(1, V5), "not armed: refused without a reply"),
    host(400, Status(9)),
    device(400, Report(9, 4, 0, 1, 0, 0, 0, 0, 0, 0, 1)),
    host(500, Hello(10, 2, 3), "versions that this device does not support"),
    device(500, Ack(10, Type.HELLO, Code.VERSION, 0, 0, 1)),
    host(600, of_version(2, Hello(11, 1, 2)), "a HELLO in a header of version 2"),
    device(600, replace(GOLDEN, number=11)),
    host(700, of_version(2, Hello(12, 2, 2)), "from a host that supports version 2 only"),
    device(700, Ack(12, Type.HELLO, Code.VERSION, 0, 0, 1)),
    host(800, of_version(2, Poll(13)), "any other frame of version 2 is ignored"),
)
_FLYING = (
    host(1000, Arm(0, 1, 2000, 0)),
    device(1000, Ack(0, Type.ARM, Code.OK, ENABLED, 0, 2)),
    device(1000, sample(0, 0, 1000, 0, ENABLED)),
    host(1300, volts(1, V5)),
    device(3000, sample(1, 1, 3000, V5, ENABLED, delay_us=300)),
)
STREAM = (
    *_FLYING,
    host(3100, volts(1, V5), "repeated: refused"),
    host(3200, volts(3, 30_000_000), "beyond the limit, and one was lost: 24 V"),
    host(3300, volts(2, V5), "overtaken: refused"),
    device(5000, sample(2, 3, 5000, 24_000_000, ENABLED | SATURATED, delay_us=200)),
    host(5400, Estop(0)),
    device(5400, Ack(0, Type.ESTOP, Code.OK, ESTOP, Cause.HOST_ESTOP, 3)),
    host(5500, volts(4, V5), "stopped: refused"),
    device(7000, sample(3, 3, 7000, 0, ESTOP, Cause.HOST_ESTOP)),
    host(7100, Arm(0, 1, 2000, 0), "the first ARM repeated: its ticket is stale"),
    device(7100, Ack(0, Type.ARM, Code.STALE_TICKET, ESTOP, Cause.HOST_ESTOP, 3)),
    host(7200, Disarm(11), "ends the stream; the stop stays until armed"),
    device(7200, Ack(11, Type.DISARM, Code.OK, ESTOP, Cause.HOST_ESTOP, 4)),
    host(9500, Arm(20, 4, 0, 0), "armed again, without a stream"),
    device(9500, Ack(20, Type.ARM, Code.OK, ENABLED, 0, 5)),
    device(9500, sample(0, 20, 9500, 0, ENABLED)),
    host(9600, Arm(21, 5, 0, 0)),
    device(9600, Ack(21, Type.ARM, Code.ALREADY_ARMED, ENABLED, 0, 5)),
)
WATCHDOG = (
    host(1000, Arm(0, 1, 0, 50_000)),
    device(1000, Ack(0, Type.ARM, Code.OK, ENABLED, 0, 2)),
    device(1000, sample(0, 0, 1000, 0, ENABLED)),
    host(2000, volts(1, V5)),
    host(52_000, Poll(2), "50 ms without a command do not exceed 50 ms"),
    device(52_000, sample(1, 1, 52_000, V5, ENABLED, delay_us=1000)),
    host(152_000, Poll(3), "expired at 52 ms, and half-way down the ramp of 200 ms"),
    device(152_000, sample(2, 1, 152_000, V5 // 2, LATCHED, Cause.WATCHDOG)),
    host(153_000, volts(2, V5), "latched: refused"),
    host(252_000, Poll(4)),
    device(252_000, sample(3, 1, 252_000, 0, LATCHED, Cause.WATCHDOG)),
    host(253_000, Status(5)),
    device(253_000, Report(5, 7, 0, 1, 1, 0, 0, 253, LATCHED, Cause.WATCHDOG, 3)),
    host(254_000, Arm(10, 3, 3_000, 5_000), "a watchdog shorter than two periods"),
    device(254_000, Ack(10, Type.ARM, Code.BAD_PARAMETER, LATCHED, Cause.WATCHDOG, 3)),
    host(255_000, Arm(10, 3, 0, 0)),
    device(255_000, Ack(10, Type.ARM, Code.OK, ENABLED, 0, 4)),
    device(255_000, sample(0, 10, 255_000, 0, ENABLED)),
)
_CUT = wire(Hello(12))[:7]
_WRONG = bytearray(wire(Poll(13)))
_WRONG[4] ^= 0x10
NOISE = (
    host(100, b"\x00\x00\x7f\xff\x13\x00", "noise between delimiters"),
    host(200, _CUT + wire(Poll(13)), "a torn frame takes the next one with it"),
    host(300, wire(Poll(14))),
    device(300, sample(0, 0, 300, 0, 0)),
    host(400, bytes(_WRONG), "one wrong bit"),
    host(500, _CUT),
    host(
        600, Estop(15), "an ESTOP begins with a delimiter, so a torn frame before it does no harm"
    ),
    device(600, Ack(15, Type.ESTOP, Code.OK, ESTOP, Cause.HOST_ESTOP, 2)),
    host(700, Status(16)),
    device(700, Report(16, 3, 4, 0, 0, 0, 0, 0, ESTOP, Cause.HOST_ESTOP, 2)),
)
LATE = (
    *_FLYING,
    host(3400, volts(2, V5)),
    held_up(9300, "samples of 5000 and 7000 are skipped, without numbers"),
    device(9300, sample(2, 2, 9300, V5, ENABLED, delay_us=400), "the time when it was read"),
    device(11000, sample(3, 2, 11000, V5, ENABLED), "on the old grid"),
    host(11_100, Status(3)),
    device(11_100, Report(3, 4, 0, 0, 0, 4300, 0, 11, ENABLED, 0, 2)),
    host(11_200, Disarm(4)),
    device(11_200, Ack(4, Type.DISARM, Code.OK, 0, 0, 3)),
)
TRANSCRIPTS = {
    "hello": HELLO, "stream": STREAM, "watchdog": WATCHDOG, "noise": NOISE, "late": LATE,
}  # fmt: skip


def text(lines: tuple[Line, ...]) -> str:
    """``time > hex``: the host sends; ``time < hex``: the device replies; ``time !``: the device
    was held up until then; ``#``: a note."""
    out = []
    for line in lines:
        if line.sender == "clock":
            out.append(f"{line.time_us} !  # held up until now: {line.note}")
            continue
        arrow = ">" if line.sender == "host" else "<"
        kind = "bytes" if isinstance(line.content, bytes) else line.content.TYPE.name
        note = f"{kind}: {line.note}" if line.note else kind
        out.append(f"{line.time_us} {arrow} {line.bytes.hex()}  # {note}")
    return "\n".join(out)


if __name__ == "__main__":
    for name, lines in TRANSCRIPTS.items():
        print(f"[{name}]\n{text(lines)}\n")
