"""Driver of ``usb://``: rigs on USB bulk pipes, by pyusb (docs/reference/protocol.md, USB)."""

from .driver import UsbDriver

__all__ = ["UsbDriver"]
