"""``usb://``: rigs on a USB bulk pipe, through pyusb. docs/reference/protocol.md, section USB."""

from .driver import UsbDriver

__all__ = ["UsbDriver"]
