"""``quanser://``: the vendor's data acquisition boards, through the vendor's HIL library."""

from .driver import QuanserDriver

__all__ = ["QuanserDriver"]
