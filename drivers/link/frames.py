"""Packs and parses the frames of protocol 1; docs/reference/protocol.md defines their meaning.

    frame   = COBS(header body check) 0x00
    header  = version u8, type u8, number u32
    check   = crc16(header body), crc16(the same bytes, last one first)

All integers are little-endian; all frames of one type have the same length. Voltages are whole
microvolts, currents whole milliamperes, times whole microseconds, so no frame can hold a NaN.

Each CRC-16 is CRC-16/IBM-3740 ("CCITT-FALSE"): x¹⁶ + x¹² + x⁵ + 1, initial value 0xFFFF, nothing
reflected, nothing inverted; "123456789" gives 0x29B1. It detects every burst of up to 16 bits, and
every one, two or three wrong bits. Any other error passes one CRC-16 with probability 2⁻¹⁶. In
reverse order the wrong bits form another error polynomial, so the two CRCs are independent: both
miss such an error with probability 2⁻³².
"""

from __future__ import annotations

import enum
from binascii import crc_hqx
from dataclasses import dataclass
from struct import Struct, pack
from typing import ClassVar, Final, get_args

from cobs.cobs import DecodeError, decode, encode

VERSION: Final = 1
NOT_MEASURED: Final = -0x8000
"""Value of a current that the device does not measure"""
LONGEST: Final = 128
"""Bytes between two delimiters at most; longer pieces are malformed"""
INITIAL = 0xFFFF
"""Initial value of the CRC-16"""
_HEADER = Struct("<BBI")


class Type(enum.IntEnum):
    """Frame types of the protocol; those that the device sends have bit 7 set."""

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
    """Result codes by which the device answers a request, in its ACK frame."""

    OK = 0
    ALREADY_ARMED = 1
    STALE_TICKET = 2
    FAULT = 3
    BAD_PARAMETER = 4
    UNKNOWN_TYPE = 5
    VERSION = 6


class Cause(enum.IntEnum):
    """Reasons why the device holds its output voltage at zero."""

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
    """Requests the device's identity. The device replies in every state with an `IdentityFrame`.

    A device that supports no protocol version from ``oldest`` to ``newest`` replies with an `Ack`
    of code `Code.VERSION` instead.
    """

    TYPE: ClassVar = Type.HELLO
    BODY: ClassVar = Struct("<BB")
    number: int
    oldest: int = VERSION
    newest: int = VERSION
    """``oldest``, ``newest``: the protocol versions that the host supports"""


@dataclass(frozen=True, slots=True)
class Arm:
    """Request to enable the output at zero volts; the device replies with an `Ack`.

    After an `Ack` with code OK the device sends sample 0.
    """

    TYPE: ClassVar = Type.ARM
    BODY: ClassVar = Struct("<III")
    number: int
    ticket: int
    """The device's current ticket, so that a repeated or delayed ARM has no effect"""
    period_us: int
    """µs from sample to sample of the stream; 0: no stream, a sample for each POLL"""
    watchdog_us: int
    """µs without a command until the device ramps to zero; 0: the device's own value"""


@dataclass(frozen=True, slots=True)
class CommandFrame:
    """Sets the motor voltages until the next command; ``number`` rises with every command."""

    TYPE: ClassVar = Type.COMMAND
    BODY: ClassVar = Struct("<ii")
    number: int
    front_uV: int
    back_uV: int


@dataclass(frozen=True, slots=True)
class Poll:
    """Request for one sample now, valid in every state; no effect while samples are streamed."""

    TYPE: ClassVar = Type.POLL
    BODY: ClassVar = Struct("")
    number: int


@dataclass(frozen=True, slots=True)
class Disarm:
    """Request to set zero volts and disable the amplifier; the device replies with an `Ack`."""

    TYPE: ClassVar = Type.DISARM
    BODY: ClassVar = Struct("")
    number: int


@dataclass(frozen=True, slots=True)
class Estop:
    """Request to set zero volts now, in every state; the device replies with an `Ack`."""

    TYPE: ClassVar = Type.ESTOP
    BODY: ClassVar = Struct("<B")
    number: int
    reason: int = int(Cause.HOST_ESTOP)


@dataclass(frozen=True, slots=True)
class Status:
    """Request for the device's counters; the device replies with a `Report`."""

    TYPE: ClassVar = Type.STATUS
    BODY: ClassVar = Struct("")
    number: int


@dataclass(frozen=True, slots=True)
class IdentityFrame:
    """Identifies the device, in reply to a `Hello`; ``number`` is the request's number."""

    TYPE: ClassVar = Type.IDENTITY
    BODY: ClassVar = Struct("<BBIIiiiIIII16s16s16s")
    number: int
    version: int
    """The protocol version that the device uses with this host"""
    flags: int
    boot: int
    """Number that changes with every start of the device, when the counts restart from zero"""
    ticket: int
    """The ticket that the next ARM must carry"""
    counts_roll: int
    counts_pitch: int
    counts_yaw: int
    """``counts_…``: counts per revolution; negative if the count falls as the angle rises"""
    v_max_uV: int
    watchdog_us: int
    ramp_us: int
    shortest_us: int
    """µs, the shortest sample period that the device can stream"""
    model: bytes
    serial: bytes
    firmware: bytes
    """``model``, ``serial``, ``firmware``: ASCII, padded with zero bytes"""


@dataclass(frozen=True, slots=True)
class Ack:
    """Reply that states the result of a request; ``number`` is the request's number."""

    TYPE: ClassVar = Type.ACK
    BODY: ClassVar = Struct("<BBBBI")
    number: int
    request: int
    """The request's type"""
    code: int
    flags: int
    cause: int
    ticket: int


@dataclass(frozen=True, slots=True)
class SampleFrame:
    """A sample: encoder counts, voltages, currents.

    ``number`` counts the samples from 0, since the last arming or the device's start.
    """

    TYPE: ClassVar = Type.SAMPLE
    BODY: ClassVar = Struct("<IIiiiiihhHBB")
    number: int
    echo: int
    """Number of the last command that the device applied, or of the ARM"""
    time_us: int
    """The device's clock modulo 2³²"""
    roll: int
    pitch: int
    yaw: int
    """``roll``, ``pitch``, ``yaw``: encoder counts since the device started"""
    front_uV: int
    back_uV: int
    """``front_uV``, ``back_uV``: the amplifier's output at ``time_us``, in µV"""
    front_mA: int
    back_mA: int
    delay_us: int
    """µs from the previous sample to the arrival of the last command; 65535: this long or longer,
    or no command has arrived since that sample"""
    flags: int
    cause: int


@dataclass(frozen=True, slots=True)
class Report:
    """Counters of frames, errors and delays since the device started, in reply to a `Status`."""

    TYPE: ClassVar = Type.REPORT
    BODY: ClassVar = Struct("<IIIIIIIBBI")
    number: int
    frames: int
    """Valid frames received"""
    malformed: int
    """Pieces received with wrong COBS, length, version or check"""
    refused: int
    """Valid frames without effect, except ARMs: refused commands and POLLs, unknown types"""
    expiries: int
    """How often the watchdog expired"""
    late_us: int
    """µs, the longest delay of a streamed sample after its due time"""
    encoder_errors: int
    """Invalid transitions of the encoder lines A and B"""
    uptime_ms: int
    flags: int
    cause: int
    ticket: int


Frame = (
    Hello | Arm | CommandFrame | Poll | Disarm | Estop | Status
    | IdentityFrame | Ack | SampleFrame | Report
)  # fmt: skip
_KINDS: dict[int, type[Frame]] = {int(k.TYPE): k for k in get_args(Frame)}
_LENGTHS = {t: _HEADER.size + k.BODY.size + 4 for t, k in _KINDS.items()}
_FIELDS = {t: tuple(k.__slots__)[1:] for t, k in _KINDS.items()}


def check(data: bytes) -> bytes:
    """Return the last four bytes of a frame, which contain two checksums of ``data``.

    The first two bytes are the CRC-16 of ``data``. The last two bytes are the CRC-16 of
    ``data[::-1]``, the same data in reverse order of its bytes. Each CRC-16 has its low byte first.
    """
    return (crc_hqx(data, INITIAL) | crc_hqx(data[::-1], INITIAL) << 16).to_bytes(4, "little")


def payload(frame: Frame) -> bytes:
    """Return header, body and check of ``frame`` as bytes, without the COBS encoding."""
    kind = int(frame.TYPE)
    body = frame.BODY.pack(*(getattr(frame, name) for name in _FIELDS[kind]))
    data = _HEADER.pack(VERSION, kind, frame.number & 0xFFFFFFFF) + body
    return data + check(data)


def wire(frame: Frame) -> bytes:
    """Return ``frame`` as the bytes to send: COBS-encoded, with the delimiter 0 at the end.

    An ESTOP also begins with a 0, so that an incomplete frame before it cannot corrupt it.
    """
    out: bytes = encode(payload(frame)) + b"\0"
    return b"\0" + out if frame.TYPE == Type.ESTOP else out


def decoded(piece: bytes) -> bytes | None:
    """Return header, body and check in ``piece``, the COBS-encoded bytes between two delimiters.

    Returns None if the COBS encoding or the check is wrong, or the piece is too short.
    """
    try:
        data: bytes = decode(piece)
    except DecodeError:
        return None
    whole = len(data) >= _HEADER.size + 4 and check(data[:-4]) == data[-4:]
    return data if whole else None


def parse(piece: bytes) -> Frame | None:
    """Return the frame in ``piece``, the COBS-encoded bytes between two delimiters.

    Returns None if they are not a valid frame. A HELLO is valid with any version in its header,
    because it asks for the device's version.
    """
    data = decoded(piece)
    if data is None or (data[0] != VERSION and data[1] != Type.HELLO):
        return None
    kind = _KINDS.get(data[1])
    if kind is None or len(data) != _LENGTHS[data[1]]:
        return None
    return kind(_HEADER.unpack_from(data)[2], *kind.BODY.unpack_from(data, _HEADER.size))


def command(number: int, front_uV: int, back_uV: int) -> bytes:
    """Return the bytes of a command frame to send.

    This function serves the control loop, because it is faster than `wire`. ``number``: the frame's
    number; ``front_uV``, ``back_uV``: motor voltages in µV.
    """
    data = pack("<BBIii", VERSION, Type.COMMAND, number, front_uV, back_uV)
    out: bytes = encode(data + check(data)) + b"\0"
    return out


class Splitter:
    """Splits a stream of received bytes at the delimiter 0 and returns the valid frames."""

    def __init__(self) -> None:
        self._rest = b""
        self.malformed = 0
        """Pieces that were not a valid frame"""

    def feed(self, data: bytes) -> list[Frame]:
        """Return the valid frames that end in the received bytes ``data``.

        An incomplete frame at the end is stored for the next call.
        """
        *whole, rest = (self._rest + data).split(b"\0")
        if len(rest) > LONGEST:  # too long for a frame: do not collect it
            rest = rest[: LONGEST + 1]
        self._rest = rest
        out = []
        for piece in whole:
            if not piece:
                continue
            frame = self.frame(piece) if len(piece) <= LONGEST else None
            if frame is None:
                self.malformed += 1
            else:
                out.append(frame)
        return out

    def frame(self, piece: bytes) -> Frame | None:
        """Return the frame in ``piece``, the bytes between two delimiters; None if invalid."""
        return parse(piece)
