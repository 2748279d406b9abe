"""The options of ``serial:`` URLs; docs/serial.md."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from .link.options import LinkOptions
from .link.serial_line import BAUD, PASSED_ON


class SerialOptions(LinkOptions):
    baud: float = Field(default=BAUD, ge=1200, le=12_000_000, description="bits per second")
    low_latency: Literal["1", "0"] = Field(
        default="1", description="1: ask the port's driver to deliver bytes at once"
    )

    @classmethod
    def names(cls) -> tuple[str, ...]:
        return super().names() + PASSED_ON
