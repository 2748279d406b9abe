"""The rig's port: what the loop asks of any rig, on the bench or emulated.

One exchange is one control period: the command takes effect at once, the sample is taken at the
period's end. So sample k's voltage follows from sample k's angles and is held until k+1::

    sample = rig.arm()
    while flying:
        command = controller(sample)
        sample = rig.exchange(command, due_s)

Where the device times the stream (``Identity.timebase == "device"``), ``due_s`` is ignored and
the call returns with the device's next sample. Where the host does, the driver waits until
``due_s`` with `heli3dof.rig.clock.wait_until` and asks then. A ``"virtual"`` clock runs as fast as
the host asks: nothing can be late. Drivers register a `Driver` under the entry-point group
``heli3dof.drivers``, by the scheme of their URLs.
"""

from __future__ import annotations

import enum
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Protocol

if TYPE_CHECKING:
    from heli3dof.rig.profile import Profile
    from heli3dof.rig.url import DeviceUrl


class Flags(enum.IntFlag):
    """What a sample says of the device's state."""

    ENABLED = 1
    """The amplifier is enabled: voltages reach the motors."""
    FAULT = 2
    """The amplifier reports a fault (overcurrent, over-temperature)."""
    STALL = 4
    """A motor draws current without turning."""
    LATCHED = 8
    """The watchdog expired; the output is zero until the device is armed again."""
    ESTOP = 16
    """An emergency stop is in force."""
    SATURATED = 32
    """The device clipped the command to its own limit."""


@dataclass(frozen=True, slots=True)
class Identity:
    """Who answers: printed by ``heli3dof devices`` and written into every recording."""

    driver: str
    model: str
    serial: str
    firmware: str
    protocol: str
    counts_per_rev: tuple[int, int, int]
    """Roll, pitch, yaw; signed as in the profile."""
    v_max: float
    """V, the amplifier's limit."""
    watchdog_s: float
    """Seconds without a command until the device ramps to zero and latches."""
    timebase: Literal["host", "device", "virtual"]
    emulated: bool
    boot: int | None = None
    """Differs after every start of the device, whose counts began at zero then; None: unknown. A
    board without a random source or flash may repeat it: ``started_s`` tells then."""
    started_s: float | None = None
    """When the device started, s since 1970 by the host's clock, from its uptime; None: unknown"""


@dataclass(frozen=True, slots=True)
class Command:
    """One period's voltages. The device echoes ``sequence`` in the sample that follows."""

    sequence: int
    v_front: float
    """V"""
    v_back: float
    """V"""


@dataclass(frozen=True, slots=True)
class Sample:
    """One reading of the rig."""

    sequence: int
    """The sequence of the last command that the device carried out."""
    device_time_s: float
    """s on the device's clock."""
    counts: tuple[int, int, int]
    """Roll, pitch, yaw encoder counts since power-up (zero at the rest angles)."""
    v_applied: tuple[float, float]
    """V, front and back: what the device put out during the period that ended now."""
    current: tuple[float, float]
    """A, front and back; NaN where not measured."""
    flags: Flags
    host_time_s: float
    """s on the host's monotonic clock when the sample arrived."""


@dataclass(frozen=True, slots=True)
class Check:
    """One line of ``heli3dof doctor``: what was looked at, what was found, what mends it."""

    what: str
    found: str
    good: bool | None
    """None: cannot tell"""
    fix: str = ""
    """The command to run, or the thing to do; empty where nothing is to be done"""


class Rig(Protocol):
    """An open connection to one rig. Every method may raise DeviceError.

    A rig at a line may have ``statistics``, a dataclass of counters since it was opened, which the
    recording's outcome keeps; ``lost`` among them, the samples that were made and never came, and
    ``device_skipped``, those that a device that was held up never made; see `link_counters`.

    A rig whose device states why it holds its output at zero may have ``device_cause``, see there.
    """

    @property
    def identity(self) -> Identity: ...

    def arm(self) -> Sample:
        """Enable the amplifier at zero volts, clear latches, and return a first sample."""
        ...

    def read(self) -> Sample:
        """A sample now, without arming or moving anything; of a rig that is not armed."""
        ...

    def exchange(self, command: Command, due_s: float) -> Sample:
        """Put out the command now; return the sample at the period's end.

        Where the host keeps time, ``due_s`` (host monotonic) is that end.
        """
        ...

    def estop(self, reason: str) -> None:
        """Zero volts now, whatever the state. Idempotent; holds until `arm`."""
        ...

    def close(self) -> None:
        """Zero volts, disable the amplifier, release the port. Idempotent."""
        ...


def device_cause(rig: object) -> str | None:
    """Why the device holds its output at zero, in its own word; None where it states nothing.

    The word is the rig's attribute ``device_cause``, as of the last sample: ``OVERCURRENT``,
    ``BUTTON``, ``WATCHDOG`` and the others of docs/protocol.md, or the driver's own.
    """
    stated = getattr(rig, "device_cause", None)
    return stated if isinstance(stated, str) and stated else None


class Driver(Protocol):
    """What a driver package registers: how to find its rigs and how to open one.

    One whose every opening makes a rig of its own, inside the process (an emulated one), adds
    ``private = True``: such a rig is neither locked nor taken for one that is there. One whose
    ``find`` lists what may be no rig adds ``surely(url) -> bool``; one that does not list all adds
    ``lasting(url) -> str``, and ``heli3dof estop`` reaches what was opened before: see
    `heli3dof.rig.session.known_devices`.
    """

    scheme: str
    """The URL scheme, e.g. ``mock``."""
    options: Sequence[str]
    """Names of the options that the URL may carry, for error messages."""

    def find(self) -> Sequence[str]:
        """Device URLs of the rigs present now. Quick, and never moves anything."""
        ...

    def open(self, url: DeviceUrl, profile: Profile) -> Rig:
        """Connect. Raises DeviceError (missing, busy, not permitted) or UsageError (options)."""
        ...

    def estop(self, url: DeviceUrl) -> str:
        """Zero volts on the rig of that URL, though another process may hold it. What was done.

        Raises DeviceError where the rig cannot be reached.
        """
        ...

    def examine(self, url: DeviceUrl) -> Sequence[Check]:
        """What ``doctor`` should know of this door before it is opened: permission, latency."""
        ...
