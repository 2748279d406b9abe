"""The URL options that every rig on the link has; docs/serial.md and docs/rigs.md."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from ..url_options import UrlOptions


class LinkOptions(UrlOptions):
    stream: Literal["1", "0"] = Field(
        default="1", description="1: the device times its samples; 0: the host asks for each one"
    )
    watchdog_s: float | None = Field(
        default=None,
        ge=1e-3,
        le=1,
        examples=[0.1],
        description="s without a command before it latches",
    )
    signs: Literal["device", "profile"] = Field(
        default="device", description="which of the two gives the encoders' counting direction"
    )
