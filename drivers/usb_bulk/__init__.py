"""``usb://``: rigs on USB bulk pipes, through pyusb. docs/reference/protocol.md, section USB."""

from .driver import UsbDriver

__all__ = ["UsbDriver"]
