"""Options of ``quanser:`` URLs: how the rig is wired to the board; see docs/how-to/quanser.md."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field

from heli3dof.errors import UsageError
from heli3dof.rig.url import DeviceUrl

from ..options import UrlOptions, expected

CHANNELS = 1000
"""Bound of the channel numbers: more than any board has"""


def _channel(value: Any) -> int:
    text = str(value)
    if not (text.isascii() and text.isdigit() and int(text) < CHANNELS):
        raise expected("a channel number: channels count from 0, as on the terminal board")
    return int(text)


def _channels(value: Any) -> tuple[int, ...]:
    parts = value.split(",") if isinstance(value, str) else value
    return () if value == "none" else tuple(map(_channel, parts))


Channel = Annotated[int, BeforeValidator(_channel)]
Channels = Annotated[tuple[int, ...], BeforeValidator(_channels)]


class Wiring(UrlOptions):
    """The board and its channels, as the URL states them.

    By default the encoders are wired as on the vendor's helicopter. The vendor's travel is
    heli3dof's yaw, its elevation is heli3dof's roll.
    """

    board: str
    """The vendor's name of the board's type, e.g. q8_usb"""
    number: str
    """Which board of that type; "0" is the first"""
    front: Channel = Field(default=0, description="analog output of the front motor's amplifier")
    back: Channel = Field(default=1, description="analog output of the back motor's amplifier")
    roll: Channel = Field(default=2, description="encoder input")
    pitch: Channel = Field(default=1, description="encoder input")
    yaw: Channel = Field(default=0, description="encoder input")
    enable: Channels = Field(
        default=(0, 1),
        examples=["0,1"],
        description="digital outputs that enable the amplifier; `none`: it has none",
    )
    enabled_by: Literal["high", "low"] = Field(default="high", description="the level that enables")
    gain: float = Field(
        default=3.0,
        ge=0.01,
        le=100,
        description="V at the motor per V at the board (VoltPAQ: 3 or 1)",
    )
    current: Channels = Field(
        default=(),
        examples=["none"],
        description="analog inputs that measure the currents, front and back: `0,1`",
    )
    amps_per_V: float = Field(default=1.0, ge=1e-3, le=1e3, description="A per V at those inputs")
    watchdog_s: float = Field(
        default=0.1,
        ge=1e-3,
        le=1.0,
        description="s without a command before the board switches off",
    )
    clock: Channel = Field(
        default=0, description="the board's hardware clock that times the samples"
    )
    counts: Literal["keep", "zero"] = Field(
        default="keep", description="`zero`: set the counts to zero at opening"
    )

    @property
    def motors(self) -> tuple[int, int]:
        """Return the numbers of the analog outputs for front and back motor."""
        return self.front, self.back

    @property
    def encoders(self) -> tuple[int, int, int]:
        """Return the numbers of the encoder inputs for roll, pitch and yaw."""
        return self.roll, self.pitch, self.yaw

    @property
    def enable_level(self) -> int:
        return int(self.enabled_by == "high")

    @classmethod
    def of(cls, url: DeviceUrl, **place: Any) -> Self:
        """Return the board and its channels, as ``url`` states them; ``place`` is not used.

        Raises UsageError if the URL names no board, has an invalid option, or uses a channel twice
        (for instance, one encoder input for roll and pitch).
        """
        board, slash, number = url.where.partition("/")
        number = number or ("" if slash else "0")
        if not board or not number:
            raise UsageError(
                f"{url.text} does not name a board.",
                cause="the board's type comes before the slash, its number after it.",
                fix="--device quanser://q8_usb/0",
            )
        wiring = super().of(url, board=board, number=number)
        _all_different(url, "front, back", wiring.motors)
        _all_different(url, "roll, pitch, yaw", wiring.encoders)
        _all_different(url, "enable", wiring.enable)
        if len(wiring.current) not in (0, 2):
            raise UsageError(
                f"{url.text}: current={url.one('current')} is not two inputs.",
                cause="there are two motors: the front one's input comes first.",
                fix="current=0,1, or omit it",
            )
        return wiring


def _all_different(url: DeviceUrl, names: str, channels: tuple[int, ...]) -> None:
    if len(set(channels)) < len(channels):
        raise UsageError(
            f"{url.text}: {names} are {', '.join(map(str, channels))}: one channel twice.",
            cause="another option uses a channel that is a default: name all of them.",
            fix="look at the terminal board and write each channel into the URL",
        )
