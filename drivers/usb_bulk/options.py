"""The options of ``usb:`` URLs; docs/rigs.md."""

from __future__ import annotations

from pydantic import Field

from ..link.options import LinkOptions


class UsbOptions(LinkOptions):
    timeout_s: float = Field(
        default=0.25, ge=1e-3, le=10, description="s that the rig may take to accept a frame"
    )
