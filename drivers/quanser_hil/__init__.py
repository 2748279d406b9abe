"""Driver of ``quanser://`` URLs: Quanser's data acquisition boards, through its HIL library."""

from .driver import QuanserDriver

__all__ = ["QuanserDriver"]
