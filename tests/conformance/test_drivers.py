"""The conformance suite on every rig that can be opened without hardware.

Every registered driver is listed in `WITHOUT_HARDWARE`, with the URLs to open, or in
`NEEDS_HARDWARE`; a test fails for one that is in neither.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack

import pytest

from heli3dof.rig.conformance import CASES, Case, conforms
from heli3dof.rig.drivers import load_driver, registered
from tests.drivers.emulated_rigs import RigProcess, emulated_rig, firmware_rig

WITHOUT_HARDWARE = {
    # A watchdog of 0.3 s: a busy computer may be silent for 0.1 s.
    "mock": (
        "mock:?speed=max",
        "mock:?speed=real&watchdog_s=0.3",
        "mock:?speed=50&start=level&seed=3",
    ),
    "serial": (
        "serial://{python}?watchdog_s=0.3",
        "serial://{python}?watchdog_s=0.3&stream=0",
        "serial://{firmware}?watchdog_s=0.3",
        "serial://{firmware}?watchdog_s=0.3&stream=0",
    ),
    "usb+mock": (
        "usb+mock:?watchdog_s=0.3",
        "usb+mock:?watchdog_s=0.3&stream=0&seed=3&start=level",
    ),
    "quanser": (
        "quanser://q8_usb/0?watchdog_s=0.3",
        "quanser://qpid_e/0?watchdog_s=0.3&front=3&back=2&roll=5&pitch=6&yaw=7&enable=4"
        "&enabled_by=low&gain=5&current=1,0&amps_per_V=0.5",
        "quanser://qpid_e/1?watchdog_s=0.3&enable=none",
    ),
}
NEEDS_HARDWARE = {"usb"}
"""Tested as ``usb+mock``, and by `make test-kernel-usb`"""
URLS = [url for urls in WITHOUT_HARDWARE.values() for url in urls]

EMULATED: dict[str, Callable[[], AbstractContextManager[RigProcess]]] = {
    "python": emulated_rig,
    "firmware": firmware_rig,
}
"""Emulated rigs in a process of their own, by the name in the URLs' braces"""


class Ports:
    """Starts the emulated rig that a URL names, once, and fills its path into the URL."""

    def __init__(self, stack: ExitStack) -> None:
        self._stack = stack
        self._paths: dict[str, str] = {}

    def fill_in(self, url: str) -> str:
        for name, start in EMULATED.items():
            if f"{{{name}}}" in url and name not in self._paths:
                self._paths[name] = self._stack.enter_context(start()).path
        return url.format(**self._paths)


@pytest.fixture(scope="module")
def ports() -> Iterator[Ports]:
    with ExitStack() as stack:
        yield Ports(stack)


@pytest.fixture
def laboratory(monkeypatch: pytest.MonkeyPatch) -> None:
    """Install a stand-in for the vendor's library, with a board of each type in the URLs."""
    from tests.drivers.quanser_hil.stand_in import install

    install(monkeypatch)


@pytest.mark.parametrize("url", URLS)
@pytest.mark.parametrize("case", CASES, ids=str)
def test_every_driver_conforms(case: Case, url: str, ports: Ports, laboratory: None) -> None:
    with ExitStack() as stack:
        opened = Ports(stack) if case.at_rest else ports
        conforms(case, opened.fill_in(url), moves=True)


def test_every_registered_driver_is_listed():
    known = set(WITHOUT_HARDWARE) | NEEDS_HARDWARE
    assert {name for name, e in registered().items() if e.module.startswith("heli3dof")} <= known


@pytest.mark.parametrize("scheme", sorted(WITHOUT_HARDWARE))
def test_a_driver_is_registered_under_its_own_scheme(scheme: str):
    assert load_driver(scheme).scheme == scheme
