"""Defines the interface between the control loop and a rig, real or emulated.

One exchange is one control period. The command takes effect at once, and the sample is taken at the
end of the period. So the voltage computed from the angles of sample k is held until sample k+1::

    sample = rig.arm()
    while flying:
        command = controller(sample)
        sample = rig.exchange(command, due_s)

``Identity.timebase`` states who keeps time:

==========  =====================================================================================
host        the driver waits until ``due_s`` (`heli3dof.rig.clock.wait_until`), then samples
device      ``due_s`` is ignored; `Rig.exchange` returns the device's next sample
virtual     each exchange advances a simulated clock by one period; no sample is ever late
==========  =====================================================================================

A driver package registers a `Driver` in the entry-point group ``heli3dof.drivers``, under the
scheme of its URLs. Each optional ability of a driver or a rig has its own `Protocol` class below.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Protocol, runtime_checkable

if TYPE_CHECKING:
    from heli3dof.rig.profile import Profile
    from heli3dof.rig.url import DeviceUrl


class Flags(enum.IntFlag):
    """The state flags in each sample of a device."""

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
    """The fixed properties of a connected device, such as serial number and voltage limit."""

    driver: str
    model: str
    serial: str
    firmware: str
    protocol: str
    counts_per_rev: tuple[int, int, int]
    """Encoder counts per revolution of roll, pitch, yaw; signed as in the profile"""
    v_max: float
    """V, the amplifier's limit."""
    watchdog_s: float
    """Seconds without a command until the device ramps to zero and latches."""
    timebase: Literal["host", "device", "virtual"]
    """What ends a control period. ``host``: the host waits until ``due_s``. ``device``: the device
    samples by its own clock. ``virtual``: each exchange, in simulated time"""
    emulated: bool
    """True if no real motor can move. The conformance cases that move motors then run without
    ``--moves``."""
    boot: int | None = None
    """Number that changes at every start of the device, when its counts begin at zero; None:
    unknown. A board without a random source or flash memory may repeat a number; ``started_s`` then
    detects the restart."""
    started_s: float | None = None
    """When the device started, s since 1970 by the host's clock, from its uptime; None: unknown"""


@dataclass(frozen=True, slots=True)
class Command:
    """The motor voltages of one control period, with a sequence number."""

    sequence: int
    """Number of the command; `Sample.sequence` states which command the device executed last."""
    v_front: float
    """V"""
    v_back: float
    """V"""


@dataclass(frozen=True, slots=True)
class Sample:
    """One reading of the rig: encoder counts, applied voltages, currents, flags and times."""

    sequence: int
    """The sequence of the last command that the device executed."""
    device_time_s: float
    """s on the device's clock."""
    counts: tuple[int, int, int]
    """Roll, pitch, yaw encoder counts: zero at power-up; from `heli3dof.open_rig`: at rest."""
    v_applied: tuple[float, float]
    """V, front and back: the device's output just before it took the sample; NaN where not
    measured."""
    current: tuple[float, float]
    """A, front and back; NaN where not measured."""
    flags: Flags
    host_time_s: float
    """s on the host's monotonic clock when the sample arrived."""


@dataclass(frozen=True, slots=True)
class Check:
    """The result of one check of ``heli3dof doctor``, and how to correct a problem."""

    what: str
    """What was examined"""
    found: str
    """The result, with its numbers"""
    good: bool | None
    """True: in order; False: run ``fix``; None: not known, or a warning with a ``fix``"""
    fix: str = ""
    """The command to run or the thing to do; empty where there is nothing to do"""


class Rig(Protocol):
    """An open connection to one real or emulated rig. Every method may raise DeviceError."""

    @property
    def identity(self) -> Identity: ...

    def arm(self) -> Sample:
        """Enable the amplifier at zero volts, end any earlier stop, and return a first sample."""
        ...

    def read(self) -> Sample:
        """Return a new sample while the rig is not armed. Nothing moves."""
        ...

    def exchange(self, command: Command, due_s: float) -> Sample:
        """Apply the command now; return the sample at the end of the control period.

        ``due_s``: the end of the period on the host's monotonic clock, in s. A rig whose device
        keeps time ignores ``due_s``.
        """
        ...

    def estop(self, reason: str) -> None:
        """In any state, set zero volts until the next `arm`; ``reason``: why. Idempotent."""
        ...

    def close(self) -> None:
        """Set zero volts, disable the amplifier, and release the device. Idempotent.

        Afterwards `arm`, `read` and `exchange` raise DeviceError with a cause and a fix; `estop`
        does nothing.
        """
        ...


@runtime_checkable
class HasLinkStatistics(Protocol):
    """Optional interface of a rig whose link counts the messages that it transfers and loses."""

    @property
    def statistics(self) -> object:
        """Return a dataclass of the link's counters since the rig was opened.

        The recording stores these counters with the flight's outcome. ``lost``: samples that the
        device sent and the host never received. ``device_skipped``: samples that a busy device did
        not take. `heli3dof.rig.link_counters` has the other names.
        """
        ...


@runtime_checkable
class ReportsDeviceCause(Protocol):
    """Optional interface of a rig whose device states why its output is zero."""

    @property
    def device_cause(self) -> str | None:
        """Return the cause of the device's stop, as stated with the last sample, or None.

        The cause is one of docs/reference/protocol.md, such as ``OVERCURRENT``, ``BUTTON`` or
        ``WATCHDOG``, or a cause that only this driver has.
        """
        ...


@runtime_checkable
class ArmsWithPermission(Protocol):
    """Optional interface of a rig whose `Rig.arm` makes several attempts.

    The session sets ``check_permission``, which raises an error if an emergency stop forbids
    arming. `Rig.arm` must call it in every attempt. If an emergency stop comes after the call, the
    device must refuse this attempt.
    """

    check_permission: Callable[[], None]
    """Raises SafetyTrip if an emergency stop was requested, which forbids arming"""


class Driver(Protocol):
    """Interface of a driver, which finds, opens and stops the rigs of one URL scheme."""

    scheme: str
    """The URL scheme, e.g. ``mock``."""
    options: Sequence[str]
    """Names of the options that the URL may carry; another name raises UsageError."""

    def find(self) -> Sequence[str]:
        """Return the device URLs of the rigs connected now. Takes at most 1 s; moves nothing."""
        ...

    def open(self, url: DeviceUrl, profile: Profile) -> Rig:
        """Return the opened rig at ``url``.

        Raises UsageError for a bad URL, DeviceError for a rig that is missing, busy or not
        permitted.
        """
        ...

    def estop(self, url: DeviceUrl) -> str:
        """Set the rig at ``url`` to zero volts, even while another process holds it.

        Returns a text that describes how the rig was stopped. Raises DeviceError if the rig cannot
        be reached.
        """
        ...

    def examine(self, url: DeviceUrl) -> Sequence[Check]:
        """Return checks made without opening the port: permission, process using it, latency."""
        ...


@runtime_checkable
class PrivateToProcess(Protocol):
    """Optional interface of a driver of emulated rigs, which exist in the opening process only.

    Other processes cannot open such a rig, so its device gets no lock. It does not count as a
    real rig (`heli3dof.rig.drivers.default_device`), and its rest angles are not stored.
    """

    private_to_process: bool


@runtime_checkable
class RecognisesRigs(Protocol):
    """Optional interface of a driver whose `Driver.find` may list ports without a rig."""

    def is_rig(self, url: DeviceUrl) -> bool:
        """Return True if the port at ``url`` now looks like a rig's, e.g. by its USB identifier."""
        ...


@runtime_checkable
class NamesPlaces(Protocol):
    """Optional interface of a driver whose `Driver.find` does not list every rig.

    ``heli3dof estop`` then also stops the rigs that were opened before and are still connected. It
    recognises them by `persistent_name` (`heli3dof.rig.session.known_devices`).
    """

    def persistent_name(self, url: DeviceUrl) -> str:
        """Return a name of the device at ``url`` that stays the same at any other port."""
        ...


def device_cause(rig: object) -> str | None:
    """Return why the rig's device holds its output at zero; None if the device states no reason."""
    cause = rig.device_cause if isinstance(rig, ReportsDeviceCause) else None
    return cause if isinstance(cause, str) and cause else None
