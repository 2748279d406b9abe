from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest
from heli3dof_drivers.quanser_hil import QuanserDriver
from heli3dof_drivers.quanser_hil.rig import QuanserRig

from heli3dof.rig.profile import Profile
from heli3dof.rig.url import parse_url
from tests.clock import Clock

from .board import PROFILE
from .stand_in import Laboratory

SLOW = PROFILE.model_copy(update={"loop": PROFILE.loop.model_copy(update={"rate_hz": 20.0})})
"""Periods of 50 ms"""


@pytest.fixture
def lab(own_clock: Clock) -> Laboratory:
    """A virtual clock: a board's buffer and watchdog depend on time."""
    return Laboratory()


@pytest.fixture
def driver(lab: Laboratory) -> QuanserDriver:
    module = lab.module()
    return QuanserDriver(lambda: module)


Open = Callable[..., QuanserRig]


@pytest.fixture
def open_board(driver: QuanserDriver) -> Iterator[Open]:
    """A function that opens rigs; they are closed after the test."""
    opened = []

    def open_(url: str = "quanser://q8_usb/0?watchdog_s=0.5", profile: Profile = SLOW):
        opened.append(driver.open(parse_url(url), profile))
        return opened[-1]

    yield open_
    for rig in opened:
        rig.close()
