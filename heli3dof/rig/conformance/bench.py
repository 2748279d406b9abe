"""The bench that a case stands at: one rig's URL, and a host that keeps its deadlines."""

from __future__ import annotations

import math
import time
import unittest
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field

from heli3dof.errors import CheckFailed, DeviceError
from heli3dof.rig.drivers import is_private, load_driver, open_rig
from heli3dof.rig.interface import Command, Driver, Flags, Rig, Sample
from heli3dof.rig.profile import Profile, default_profile
from heli3dof.rig.url import parse_url

PATIENCE = 20
"""Periods in which one command must arrive"""
NEAR_V = 0.01
"""V by which a voltage may differ from the one that was asked for"""


class NotConforming(CheckFailed):
    """A driver does not do what the port asks of it."""


class Host:
    """A rig, and a host that meets its absolute deadlines."""

    def __init__(self, rig: Rig, dt: float) -> None:
        self.rig, self.dt = rig, dt
        self.sequence = 0
        self.due = 0.0
        """s, monotonic: the last deadline"""

    def arm(self) -> Sample:
        sample = self.rig.arm()
        self.due = time.monotonic()
        return sample

    def send(self, v_front: float, v_back: float) -> Sample:
        """One period; deadlines that were missed altogether are skipped."""
        self.sequence += 1
        self.due += self.dt * max(1, math.ceil((time.monotonic() - self.due) / self.dt))
        return self.rig.exchange(Command(self.sequence, v_front, v_back), self.due)

    def hold(self, v_front: float, v_back: float) -> Sample:
        """Send until a sample echoes it: on a busy machine a command may miss its period."""
        for _ in range(PATIENCE):
            sample = self.send(v_front, v_back)
            if sample.sequence == self.sequence:
                return sample
        owed(False, f"a command carried out, of {PATIENCE} that were sent", sample)
        raise AssertionError


@dataclass
class Bench:
    """Where a case stands. Rigs that it opens are closed when it is over."""

    url: str
    profile: Profile
    moves: bool | None = None
    """May motors move? None: of emulated rigs only"""
    _rigs: ExitStack = field(default_factory=ExitStack)

    @property
    def driver(self) -> Driver:
        return load_driver(parse_url(self.url).scheme)

    @property
    def private(self) -> bool:
        """Nobody else can hold this rig: every opening makes one."""
        return is_private(self.url)

    def open(self) -> Host:
        rig = open_rig(self.url, self.profile)
        self._rigs.callback(rig.close)
        return Host(rig, self.profile.dt)

    def close(self) -> None:
        self._rigs.close()

    def open_to_move(self) -> Host:
        """Open, for a case that moves the motors; skip it where they must not move."""
        host = self.open()
        moves = host.rig.identity.emulated if self.moves is None else self.moves
        if not moves:
            raise unittest.SkipTest("moves a real rig")
        return host


@dataclass(frozen=True)
class Case:
    """One thing that is owed. ``at_rest``: of a rig that nobody has flown since its start."""

    name: str
    check: Callable[[Bench], None]
    at_rest: bool = False

    def __str__(self) -> str:
        return self.name


def cases(*checks: Callable[[Bench], None]) -> tuple[Case, ...]:
    """Cases of functions, which are named as the statement that they check."""
    return tuple(Case(c.__name__, c) for c in checks)


def conforms(
    case: Case, url: str, profile: Profile | None = None, *, moves: bool | None = None
) -> None:
    """Run one case over a device URL. Raises NotConforming, SkipTest, or the driver's own error.

    ``profile``: the rig's, the paper's unless given. ``moves``: may motors move? Emulated ones
    may unless said otherwise; a real rig stands free of people then.
    """
    bench = Bench(url, profile or default_profile(), moves)
    try:
        case.check(bench)
    finally:
        bench.close()


def owed(ok: object, what: str, found: object) -> None:
    """Raise NotConforming unless ``ok``: ``what`` is owed, and ``found`` is what there was."""
    if not ok:
        raise NotConforming(
            f"{what}; found: {found}",
            cause="the driver, or the device behind it, does otherwise than the port says.",
            fix="read heli3dof/rig/interface.py and docs/how-to/write-a-driver.md",
        )


def owed_volts(sample: Sample, v_front: float, v_back: float, when: str) -> None:
    front, back = sample.v_applied
    near = abs(front - v_front) <= NEAR_V and abs(back - v_back) <= NEAR_V
    owed(near, f"{v_front:g} V and {v_back:g} V applied {when}", sample.v_applied)


def owed_rest(sample: Sample, when: str) -> None:
    """Zero volts, exactly, and not enabled."""
    owed(sample.v_applied == (0.0, 0.0), f"zero volts {when}", sample.v_applied)
    owed(not sample.flags & Flags.ENABLED, f"not enabled {when}", sample.flags)


def owed_error(call: Callable[[], object], when: str) -> DeviceError:
    """The DeviceError that is owed, with what to do in it."""
    try:
        found = call()
    except DeviceError as problem:
        owed(
            problem.fix and problem.cause, f"an error that says why and what to do {when}", problem
        )
        return problem
    owed(False, f"a DeviceError {when}", found)
    raise AssertionError
