"""The frames of protocol 1, byte by byte; docs/reference/protocol.md says what they mean.

    frame   = COBS(header body check) 0x00
    header  = version u8, type u8, number u32
    check   = crc16(header body), crc16(header body backwards)

All integers are little-endian, every type has one length. Voltages are whole microvolts, currents
whole milliamperes, times whole microseconds: no frame can hold a number that is not one.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass
from struct import Struct, pack
from typing import ClassVar, Final

from cobs.cobs import DecodeError, decode, encode

from .checksum import check

VERSION: Final = 1
NOT_MEASURED: Final = -0x8000
"""A current that the device does not measure."""
LONGEST: Final = 128
"""Bytes between two delimiters; what is longer is no frame."""
_HEADER = Struct("<BBI")


class Type(enum.IntEnum):
    """Bit 7: from the device."""

    HELLO = 0x01
    ARM = 0x02
    COMMAND = 0x03
    POLL = 0x04
    DISARM = 0x05
    ESTOP = 0x06
    STATUS = 0x07
    IDENTITY = 0x81
    ACK = 0x82
    SAMPLE = 0x83
    REPORT = 0x87


class Code(enum.IntEnum):
    """What an ACK says."""

    OK = 0
    ALREADY_ARMED = 1
    STALE_TICKET = 2
    FAULT = 3
    BAD_PARAMETER = 4
    UNKNOWN_TYPE = 5
    VERSION = 6


class Cause(enum.IntEnum):
    """Why the output is held at zero."""

    NONE = 0
    WATCHDOG = 1
    HOST_ESTOP = 2
    BUTTON = 3
    OVERCURRENT = 4
    OVERTEMPERATURE = 5
    STALL = 6
    ENCODER = 7
    SUPPLY = 8
    SATURATED = 9


@dataclass(frozen=True, slots=True)
class Hello:
    """Who is there? Answered in every state by an `IdentityFrame`."""

    TYPE: ClassVar = Type.HELLO
    BODY: ClassVar = Struct("<BB")
    number: int
    oldest: int = VERSION
    newest: int = VERSION
    """Protocol versions that the host speaks"""


@dataclass(frozen=True, slots=True)
class Arm:
    """Enable at zero volts. Answered by an `Ack`, then by sample 0."""

    TYPE: ClassVar = Type.ARM
    BODY: ClassVar = Struct("<III")
    number: int
    ticket: int
    """The device's present one: a repeated or delayed ARM arms nothing"""
    period_us: int
    """0: a sample for each POLL; else a sample every so many microseconds"""
    watchdog_us: int
    """0: the device's own"""


@dataclass(frozen=True, slots=True)
class CommandFrame:
    """Voltages, from now until the next command. ``number`` rises with every one."""

    TYPE: ClassVar = Type.COMMAND
    BODY: ClassVar = Struct("<ii")
    number: int
    front_uV: int
    back_uV: int


@dataclass(frozen=True, slots=True)
class Poll:
    """A sample now, in every state."""

    TYPE: ClassVar = Type.POLL
    BODY: ClassVar = Struct("")
    number: int


@dataclass(frozen=True, slots=True)
class Disarm:
    """Zero volts, amplifier disabled. Answered by an `Ack`."""

    TYPE: ClassVar = Type.DISARM
    BODY: ClassVar = Struct("")
    number: int


@dataclass(frozen=True, slots=True)
class Estop:
    """Zero volts now, in every state, whatever the number. Answered by an `Ack`."""

    TYPE: ClassVar = Type.ESTOP
    BODY: ClassVar = Struct("<B")
    number: int
    reason: int = int(Cause.HOST_ESTOP)


@dataclass(frozen=True, slots=True)
class Status:
    """How has the link been? Answered by a `Report`."""

    TYPE: ClassVar = Type.STATUS
    BODY: ClassVar = Struct("")
    number: int


@dataclass(frozen=True, slots=True)
class IdentityFrame:
    """Who answers. ``number`` is the question's."""

    TYPE: ClassVar = Type.IDENTITY
    BODY: ClassVar = Struct("<BBIIiiiIIII16s16s16s")
    number: int
    version: int
    """The protocol that this device speaks with this host"""
    flags: int
    boot: int
    """Differs after every start of the device: the counts began at zero then"""
    ticket: int
    """What the next ARM must carry"""
    counts_roll: int
    counts_pitch: int
    counts_yaw: int
    """Per revolution, negative where the count falls as the angle rises"""
    v_max_uV: int
    watchdog_us: int
    ramp_us: int
    shortest_us: int
    """The shortest period of its stream"""
    model: bytes
    serial: bytes
    firmware: bytes
    """ASCII, padded with zeros"""


@dataclass(frozen=True, slots=True)
class Ack:
    """What became of a request; ``number`` is the request's."""

    TYPE: ClassVar = Type.ACK
    BODY: ClassVar = Struct("<BBBBI")
    number: int
    request: int
    """Its type"""
    code: int
    flags: int
    cause: int
    ticket: int


@dataclass(frozen=True, slots=True)
class SampleFrame:
    """One reading. ``number`` counts the samples since the device was armed, POLLed ones too."""

    TYPE: ClassVar = Type.SAMPLE
    BODY: ClassVar = Struct("<IIiiiiihhHBB")
    number: int
    echo: int
    """The number of the last command carried out"""
    time_us: int
    """The device's clock, modulo 2³²"""
    roll: int
    pitch: int
    yaw: int
    """Counts since the device started"""
    front_uV: int
    back_uV: int
    """What was put out until now"""
    front_mA: int
    back_mA: int
    delay_us: int
    """From the sample before to the arrival of the command that is echoed; 65535: longer"""
    flags: int
    cause: int


@dataclass(frozen=True, slots=True)
class Report:
    """The link as the device saw it since it started."""

    TYPE: ClassVar = Type.REPORT
    BODY: ClassVar = Struct("<IIIIIIIBBI")
    number: int
    frames: int
    """Whole and right"""
    damaged: int
    """COBS, length or check wrong"""
    refused: int
    """Right, but of no use: stale or repeated commands, unknown types"""
    expiries: int
    """Of the watchdog"""
    late_us: int
    """The longest that a sample of the stream was late"""
    encoder_errors: int
    """Impossible steps of A and B"""
    uptime_ms: int
    flags: int
    cause: int
    ticket: int


Frame = (
    Hello | Arm | CommandFrame | Poll | Disarm | Estop | Status
    | IdentityFrame | Ack | SampleFrame | Report
)  # fmt: skip
_KINDS: dict[int, type[Frame]] = {
    int(k.TYPE): k
    for k in (
        Hello, Arm, CommandFrame, Poll, Disarm, Estop, Status,
        IdentityFrame, Ack, SampleFrame, Report,
    )
}  # fmt: skip
_LENGTHS = {t: _HEADER.size + k.BODY.size + 4 for t, k in _KINDS.items()}
_FIELDS = {t: tuple(k.__slots__)[1:] for t, k in _KINDS.items()}


def payload(frame: Frame) -> bytes:
    """Header, body and check."""
    kind = int(frame.TYPE)
    body = frame.BODY.pack(*(getattr(frame, name) for name in _FIELDS[kind]))
    data = _HEADER.pack(VERSION, kind, frame.number & 0xFFFFFFFF) + body
    return data + check(data)


def wire(frame: Frame) -> bytes:
    """What goes down the line, delimiter included; an ESTOP begins with one too, so that it is
    read whatever was torn before it."""
    out: bytes = encode(payload(frame)) + b"\0"
    return b"\0" + out if frame.TYPE == Type.ESTOP else out


def parse(stuffed: bytes) -> Frame | None:
    """The frame between two delimiters; None for anything that is not exactly one.

    A HELLO is one whatever the version in its header: it asks which versions there are.
    """
    try:
        data = decode(stuffed)
    except DecodeError:
        return None
    if len(data) < _HEADER.size + 4 or (data[0] != VERSION and data[1] != Type.HELLO):
        return None
    kind = _KINDS.get(data[1])
    if kind is None or len(data) != _LENGTHS[data[1]] or check(data[:-4]) != data[-4:]:
        return None
    return kind(_HEADER.unpack_from(data)[2], *kind.BODY.unpack_from(data, _HEADER.size))


def command(number: int, front_uV: int, back_uV: int) -> bytes:
    """``wire(CommandFrame(…))``, for the loop: one pack, one check, one stuffing."""
    data = pack("<BBIii", VERSION, Type.COMMAND, number, front_uV, back_uV)
    out: bytes = encode(data + check(data)) + b"\0"
    return out


class Splitter:
    """Bytes in as they come, frames out: whatever is between two delimiters and is right."""

    def __init__(self) -> None:
        self._rest = b""
        self.damaged = 0
        """Pieces that were no frame"""

    def feed(self, data: bytes) -> list[Frame]:
        """The frames that these bytes complete, in order."""
        *whole, rest = (self._rest + data).split(b"\0")
        if len(rest) > LONGEST:  # no frame is as long; its end is not waited for in memory
            rest = rest[: LONGEST + 1]
        self._rest = rest
        out = []
        for piece in whole:
            if not piece:
                continue
            frame = self.frame(piece) if len(piece) <= LONGEST else None
            if frame is None:
                self.damaged += 1
            else:
                out.append(frame)
        return out

    def frame(self, piece: bytes) -> Frame | None:
        """What a piece is taken for; a device that answers unknown types has its own."""
        return parse(piece)
