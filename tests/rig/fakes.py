"""A driver without hardware whose rigs are not private; it records its calls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import pytest

from heli3dof.errors import DeviceError
from heli3dof.rig import drivers
from heli3dof.rig.interface import Check, Command, Flags, Identity, Sample

IDENTITY = Identity(
    "fake", "fake rig", "F-1", "1.0", "1", (4096, 4096, 8192), 24.0, 0.1, "device", True, boot=7
)


class FakeRig:
    """Stands where `counts` says; `script` may change each sample that is read."""

    def __init__(self, driver: FakeDriver) -> None:
        self.driver = driver
        self.identity = driver.identity
        self.armed = 0
        self.stopped: list[str] = []
        self.k = 0

    def read(self) -> Sample:
        self.k += 1
        if self.driver.silent_after is not None and self.k > self.driver.silent_after:
            raise DeviceError("The rig does not answer.", cause="the cable.", fix="plug it in")
        sample = Sample(
            0, self.k * 2e-3, self.driver.counts, (0.0, 0.0), (0.0, 0.0), Flags(0), self.k * 2e-3
        )
        changed = self.driver.script.get(self.k, {})
        return replace(sample, **changed)

    def arm(self) -> Sample:
        self.armed += 1
        return replace(self.read(), flags=Flags.ENABLED)

    def exchange(self, command: Command, due_s: float) -> Sample:
        flags = Flags.ESTOP if self.stopped else Flags.ENABLED
        volts = (0.0, 0.0) if self.stopped else (command.v_front, command.v_back)
        return replace(self.read(), sequence=command.sequence, v_applied=volts, flags=flags)

    def estop(self, reason: str) -> None:
        self.stopped.append(reason)

    def close(self) -> None:
        self.driver.closed += 1


@dataclass
class FakeDriver:
    """`find` finds `urls`; `estop` fails with `cannot_stop`."""

    scheme: str = "fake"
    options: Sequence[str] = ("speed",)
    urls: Sequence[str] = ("fake://1",)
    identity: Identity = IDENTITY
    counts: tuple[int, int, int] = (0, 0, 0)
    script: dict[int, dict[str, Any]] = field(default_factory=dict)
    silent_after: int | None = None
    checks: Sequence[Check] = ()
    stops: list[str] = field(default_factory=list)
    cannot_stop: str | None = None
    rigs: list[FakeRig] = field(default_factory=list)
    closed: int = 0

    def find(self) -> Sequence[str]:
        return self.urls

    def open(self, url: object, profile: object) -> FakeRig:
        self.rigs.append(FakeRig(self))
        return self.rigs[-1]

    def estop(self, url: Any) -> str:
        if self.cannot_stop is not None:
            raise DeviceError(self.cannot_stop)
        self.stops.append(url.text)
        return "the device said that it stopped"

    def examine(self, url: object) -> Sequence[Check]:
        return self.checks


@dataclass(frozen=True)
class _Entry:
    driver: object
    value: str = "tests.rig.fakes:FakeDriver"

    def load(self) -> Any:
        if isinstance(self.driver, Exception):
            raise self.driver
        return lambda: self.driver


def only_drivers(monkeypatch: pytest.MonkeyPatch, **by_scheme: object) -> None:
    """Register these drivers and no others; an exception is a driver that fails to import."""
    entries = {scheme: _Entry(driver) for scheme, driver in by_scheme.items()}
    monkeypatch.setattr(drivers, "registered", lambda: entries)
