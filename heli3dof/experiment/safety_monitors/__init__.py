"""Safety monitors: they detect a fault during a flight and report why the flight must end now.

Each monitor is a subclass of `SafetyMonitor` in a file of this package. In every control period,
the loop calls the monitors one after another, in the order of `monitor_classes`. A monitor's report
is stored in the recording and ends the flight. The loop then ramps the voltages to zero, or stops
the device at once if the monitor demands this (`SafetyMonitor.stop_without_ramp`). No monitor
changes a command. The limits are in the profile's ``[limits]``. docs/reference/safety.md states how
a flight ends after each report.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cache
from typing import ClassVar

from heli3dof.errors import Heli3dofError
from heli3dof.experiment.control_loop.control_period import Period
from heli3dof.plugins import modules_of
from heli3dof.rig.profile import Profile

HELPERS = ("axis_observer", "wiring_fault")
"""Files of this folder without monitors"""


class SafetyMonitor(ABC):
    """Base class of safety monitors. The loop calls each of a flight's monitors in every period."""

    order: ClassVar[int]
    """The loop calls the monitors in ascending ``order``; the first report ends the flight."""

    @abstractmethod
    def __init__(self, profile: Profile) -> None: ...

    @abstractmethod
    def __call__(self, now: Period) -> str | None:
        """Return why the flight must end in the control period ``now``; None if it may go on."""

    def stop_without_ramp(self) -> str | None:
        """Return why the device must be stopped at once, without a ramp to zero, or None."""
        return None

    def awaits_fall(self) -> bool:
        """Return True if the loop must wait at zero volts until the arm falls; default: False.

        The loop calls this method when it has ramped the voltages to zero after a completed plan.
        Without thrust, the arm falls onto the table. If the roll encoder reads a constant angle
        above the table, the arm has not begun to fall, or the encoder is frozen. A monitor returns
        True in this case. The loop then waits, for at most `ramp_down.FALL_S` seconds. In this
        time, the safety monitors can still report a frozen encoder. Then the flight ends.
        """
        return False


@cache
def monitor_classes() -> tuple[type[SafetyMonitor], ...]:
    """Return this package's subclasses of `SafetyMonitor`, in ascending `SafetyMonitor.order`.

    Raises Heli3dofError if a file of this folder has none and is not one of the `HELPERS`.
    """
    found: set[type[SafetyMonitor]] = set()
    for module in modules_of(__name__):
        here = {
            value
            for value in vars(module).values()
            if isinstance(value, type)
            and issubclass(value, SafetyMonitor)
            and value.__module__ == module.__name__
        }
        if not here and module.__name__.rpartition(".")[2] not in HELPERS:
            raise Heli3dofError(
                f"{module.__name__.replace('.', '/')}.py contains no safety monitor that can run.",
                cause="its class is not a subclass of SafetyMonitor.",
                fix="write class NAME(SafetyMonitor), or name a file without monitors in HELPERS "
                "of heli3dof/experiment/safety_monitors/__init__.py",
            )
        found |= here
    return tuple(sorted(found, key=lambda kind: (kind.order, kind.__name__)))


def monitors_for(profile: Profile) -> tuple[SafetyMonitor, ...]:
    """Return new safety monitors for one flight; their limits are those of ``profile``."""
    return tuple(kind(profile) for kind in monitor_classes())
