"""Runs conformance cases on a device URL; `Host` sends the commands at absolute deadlines."""

from __future__ import annotations

import math
import time
import unittest
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field

from heli3dof.errors import CheckFailed, DeviceError, Heli3dofError
from heli3dof.rig.drivers import is_private, load_driver, open_driver
from heli3dof.rig.interface import Command, Driver, Flags, Rig, Sample
from heli3dof.rig.profile import Profile, default_profile
from heli3dof.rig.url import parse_url

PATIENCE = 20
"""Number of times that a command is sent until a sample must have echoed it"""
NEAR_V = 0.01
"""V by which an applied voltage may differ from the command"""


class NotConforming(CheckFailed):
    """Raised if a driver violates a requirement of `heli3dof.rig.interface`."""


class MovesRealRig(unittest.SkipTest):
    """Raised if a case would move motors, and ``moves`` of `conforms` does not permit this."""


class Host:
    """Sends a rig one command in each control period of ``dt`` s, at absolute deadlines."""

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
        """Apply both motors' voltages (V) until the next deadline; return the sample taken then."""
        self.sequence += 1
        self.due += self.dt * max(1, math.ceil((time.monotonic() - self.due) / self.dt))
        return self.rig.exchange(Command(self.sequence, v_front, v_back), self.due)

    def hold(self, v_front: float, v_back: float) -> Sample:
        """Send the voltages (V) every period until a sample echoes them; return that sample.

        A sample echoes a command by its number. On a busy computer a command may miss its period.
        Raises NotConforming if none of `PATIENCE` commands is echoed.
        """
        for _ in range(PATIENCE):
            sample = self.send(v_front, v_back)
            if sample.sequence == self.sequence:
                return sample
        require(False, f"a command executed, of {PATIENCE} sent", sample)
        raise AssertionError


@dataclass
class Bench:
    """Provides the driver of a device URL to a conformance test, and closes the rigs it opened."""

    url: str
    profile: Profile
    moves: bool | None = None
    """True if the motors may move; None: only if the rig is emulated"""
    _rigs: ExitStack = field(default_factory=ExitStack)

    @property
    def driver(self) -> Driver:
        return load_driver(parse_url(self.url).scheme)

    @property
    def private(self) -> bool:
        """Return True if the rig is emulated (`heli3dof.rig.interface.PrivateToProcess`)."""
        return is_private(self.url)

    def open(self) -> Host:
        rig = open_driver(self.url, self.profile)
        self._rigs.callback(rig.close)
        return Host(rig, self.profile.dt)

    def close(self) -> None:
        self._rigs.close()

    def open_to_move(self) -> Host:
        """Open the rig; return its `Host`. Raises `MovesRealRig` if the motors must not turn."""
        host = self.open()
        moves = host.rig.identity.emulated if self.moves is None else self.moves
        if not moves:
            raise MovesRealRig("moves a real rig")
        return host


@dataclass(frozen=True)
class Case:
    """A conformance case: a requirement on a driver, with its test ``check``.

    ``at_rest``: True if the case needs a rig that no other case has moved before.
    """

    name: str
    check: Callable[[Bench], None]
    at_rest: bool = False

    def __str__(self) -> str:
        return self.name


def cases(*checks: Callable[[Bench], None]) -> tuple[Case, ...]:
    """Return a `Case` for each test function in ``checks``, named after the function."""
    return tuple(Case(c.__name__, c) for c in checks)


def conforms(
    case: Case, url: str, profile: Profile | None = None, *, moves: bool | None = None
) -> None:
    """Run one case on a device URL. Raises NotConforming, SkipTest, or the driver's own error.

    ``profile``: the rig's profile; default: the profile of the paper's rig. ``moves``: True if the
    motors may move; None: they may move only if the rig is emulated. Keep people away from a real
    rig.
    """
    bench = Bench(url, profile or default_profile(), moves)
    try:
        case.check(bench)
    finally:
        bench.close()


def require(ok: object, what: str, found: object) -> None:
    """Raise NotConforming unless ``ok`` is true.

    ``what``: the requirement, ``found``: the actual result; both are for the message.
    """
    if not ok:
        raise NotConforming(
            f"{what}; found: {found}",
            cause="the driver, or the device behind it, violates the rig interface.",
            fix="read heli3dof/rig/interface.py and docs/how-to/write-a-driver.md",
        )


def require_volts(sample: Sample, v_front: float, v_back: float, when: str) -> None:
    """Raise NotConforming unless the sample has these voltages, or NaN: not measured."""
    what = f"{v_front:g} V and {v_back:g} V applied {when}"
    _require_near(sample, (v_front, v_back), NEAR_V, what)


def require_zero_volts(sample: Sample, when: str) -> None:
    """Raise NotConforming unless the sample has exactly 0 V, or NaN: not measured."""
    _require_near(sample, (0.0, 0.0), 0.0, f"zero volts {when}")


def _require_near(sample: Sample, volts: tuple[float, float], within: float, what: str) -> None:
    pairs = zip(sample.v_applied, volts, strict=True)
    require(not any(abs(v - w) > within for v, w in pairs), what, sample.v_applied)


def require_rest(sample: Sample, when: str) -> None:
    """Raise NotConforming unless the sample has 0 V and a disabled amplifier.

    ``when``: the situation, for the message.
    """
    require_zero_volts(sample, when)
    require(not sample.flags & Flags.ENABLED, f"not enabled {when}", sample.flags)


def require_error(
    call: Callable[[], object], when: str, kind: type[Heli3dofError] = DeviceError
) -> Heli3dofError:
    """Call ``call``, which must raise an error of this kind with cause and fix; return this error.

    Without such an error the case fails, and ``when`` names the situation in the message.
    """
    try:
        found = call()
    except kind as problem:
        require(problem.fix and problem.cause, f"an error with cause and fix {when}", problem)
        return problem
    require(False, f"a {kind.__name__} {when}", found)
    raise AssertionError
