"""``usb://``: rigs on a USB bulk pipe, through pyusb. docs/protocol.md, section USB."""

from .driver import UsbDriver

__all__ = ["UsbDriver"]
