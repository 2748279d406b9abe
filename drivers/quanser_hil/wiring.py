"""What is plugged in where: the URL's options, checked.

============  =======  ==================================================================
option        default  meaning
============  =======  ==================================================================
front, back   0, 1     analog outputs of the motors' amplifiers
yaw           0        encoder inputs, by default as the vendor's helicopter is wired:
pitch         1        its travel is our yaw, its elevation our roll
roll          2
enable        0,1      digital outputs that enable the amplifier; ``none``: it has none
enabled_by    high     the level that enables: ``high`` or ``low``
gain          3        V at the motor per V at the board (VoltPAQ: 3 or 1, by its switch)
current       none     analog inputs that carry the currents, front and back: ``0,1``
amps_per_V    1        A per V at those inputs
watchdog_s    0.1      s of silence until the board itself puts the outputs to rest
clock         0        the board's hardware clock that times the samples
counts        keep     ``zero``: count from here; else from wherever the board stands
============  =======  ==================================================================
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from heli3dof.errors import UsageError, did_you_mean

if TYPE_CHECKING:
    from heli3dof.rig.url import DeviceUrl

OPTIONS = (
    "front", "back", "roll", "pitch", "yaw", "enable", "enabled_by", "gain", "current",
    "amps_per_V", "watchdog_s", "clock", "counts",
)  # fmt: skip


@dataclass(frozen=True)
class Wiring:
    """The board, its channels and what stands behind them."""

    board: str
    """The vendor's name of the board's type, e.g. q8_usb"""
    number: str
    """Which board of that type: "0" is the first"""
    motors: tuple[int, int] = (0, 1)
    """Analog outputs, front and back"""
    encoders: tuple[int, int, int] = (2, 1, 0)
    """Encoder inputs: roll, pitch, yaw"""
    enable: tuple[int, ...] = (0, 1)
    """Digital outputs"""
    enabled_by: int = 1
    gain: float = 3.0
    currents: tuple[int, int] | None = None
    """Analog inputs, front and back"""
    amps_per_V: float = 1.0
    watchdog_s: float = 0.1
    clock: int = 0
    zero_counts: bool = False

    @staticmethod
    def of(url: DeviceUrl) -> Wiring:
        """Raises UsageError for a place or an option that makes no sense."""
        url.check_options(OPTIONS)
        board, slash, number = url.where.partition("/")
        number = number or ("" if slash else "0")
        if not board or not number:
            raise UsageError(
                f"{url.text} does not name a board.",
                cause="the board's type stands before the slash, its number after it.",
                fix="--device quanser://q8_usb/0",
            )
        motors = (_channel(url, "front", 0), _channel(url, "back", 1))
        encoders = (_channel(url, "roll", 2), _channel(url, "pitch", 1), _channel(url, "yaw", 0))
        _all_different(url, "front, back", motors)
        _all_different(url, "roll, pitch, yaw", encoders)
        enable = _channels(url, "enable", "0,1")
        _all_different(url, "enable", enable)
        currents = _channels(url, "current", "none")
        if len(currents) not in (0, 2):
            raise UsageError(
                f"{url.text}: current={url.one('current')} is not two inputs.",
                cause="there are two motors: the front one's input stands first.",
                fix="current=0,1, or leave it out",
            )
        return Wiring(
            board,
            number,
            motors,
            encoders,
            enable,
            enabled_by=_choice(url, "enabled_by", ("high", "low")) == "high",
            gain=_number(url, "gain", 3.0, 0.01, 100),
            currents=(currents[0], currents[1]) if currents else None,
            amps_per_V=_number(url, "amps_per_V", 1.0, 1e-3, 1e3),
            watchdog_s=_number(url, "watchdog_s", 0.1, 1e-3, 1.0),
            clock=_channel(url, "clock", 0),
            zero_counts=_choice(url, "counts", ("keep", "zero")) == "zero",
        )


def _all_different(url: DeviceUrl, names: str, channels: tuple[int, ...]) -> None:
    if len(set(channels)) < len(channels):
        raise UsageError(
            f"{url.text}: {names} are {', '.join(map(str, channels))}: one channel twice.",
            cause="a default that another option took: name all of them.",
            fix="look at the terminal board and write each channel into the URL",
        )


def _channel(url: DeviceUrl, name: str, default: int) -> int:
    return _whole(url, name, str(url.one(name, str(default))))


def _channels(url: DeviceUrl, name: str, default: str) -> tuple[int, ...]:
    text = str(url.one(name, default))
    return () if text == "none" else tuple(_whole(url, name, part) for part in text.split(","))


def _whole(url: DeviceUrl, name: str, text: str) -> int:
    if not (text.isascii() and text.isdigit() and int(text) < 1000):
        raise UsageError(
            f"{url.text}: {name}={url.one(name)} is not a channel number.",
            cause="channels are counted from 0, as on the terminal board.",
            fix=f"{name}=0 (the board's page of the HIL documentation lists its channels)",
        )
    return int(text)


def _number(url: DeviceUrl, name: str, default: float, low: float, high: float) -> float:
    text = url.one(name)
    if text is None:
        return default
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not low <= value <= high:
        raise UsageError(
            f"{url.text}: {name}={text} is not a number from {low:g} to {high:g}.",
            cause="a typing error or another unit.",
            fix=f"{name}={default:g}",
        )
    return value


def _choice(url: DeviceUrl, name: str, known: tuple[str, ...]) -> str:
    text = str(url.one(name, known[0]))
    if text not in known:
        raise UsageError(
            f"{url.text}: {name}={text} is none of {', '.join(known)}.",
            cause=f"a typing error; {did_you_mean(text, known)}",
            fix=f"{name}={known[0]}",
        )
    return text
