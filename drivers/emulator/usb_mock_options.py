"""The options of ``usb+mock:`` URLs; docs/mock.md."""

from __future__ import annotations

from pydantic import Field

from ..mock_options import RigOptions
from ..usb_bulk.options import UsbOptions


class UsbMockOptions(UsbOptions, RigOptions):
    """Where both have an option, `UsbOptions` gives its bounds."""

    bus: tuple[str, ...] = Field(
        default=(), description="faults of the bus: KIND@SECONDS[:FOR_SECONDS]"
    )
