"""Checks the port, the computer, the disk and the rig before a flight; no motor turns.

The groups of checks, and where each group comes from:

- ``port``: the driver's `heli3dof.rig.interface.Driver.examine`, before the port is opened
- ``computer``: `heli3dof.rig.doctor.host` and the real-time priority that the system grants
- ``recordings``: `heli3dof.rig.doctor.folder`
- ``rig``: `heli3dof.rig.doctor.link`, on the open rig
- ``armed``: `heli3dof.rig.doctor.armed`, at zero volts, only with ``arm=True``
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from heli3dof.errors import DeviceError
from heli3dof.experiment.control_loop.realtime_priority import realtime
from heli3dof.rig.doctor import armed, host, link
from heli3dof.rig.doctor import folder as recordings
from heli3dof.rig.drivers import check_url, default_device, driver_errors, load_driver
from heli3dof.rig.interface import Check
from heli3dof.rig.profile import Profile, default_profile
from heli3dof.rig.session.open_exclusive import open_rig

FOLDER = Path("flights")
"""Where ``heli3dof run`` writes recordings by default"""


@dataclass(frozen=True)
class DoctorReport:
    """Results of ``heli3dof doctor``: every check of one rig with the name of the check's group."""

    device: str
    checks: tuple[tuple[str, Check], ...]
    opened: bool
    """True if the rig could be opened, and no check raised DeviceError"""

    @property
    def failed(self) -> list[Check]:
        return [check for _, check in self.checks if check.good is False]


def doctor(
    device: str | None = None,
    profile: Profile | None = None,
    *,
    folder: str | Path = FOLDER,
    arm: bool = False,
    each: Callable[[Check], None] = lambda check: None,
) -> DoctorReport:
    """Run every check and return the report; call ``each`` with each check when it is done.

    ``device``: the rig's URL. None selects the URL in the environment variable HELI3DOF_DEVICE,
    else the real rig if exactly one is found, or the emulated rig if none is. ``folder``: the
    folder of the recordings. ``arm``: True also arms the rig at zero volts, which tests its
    watchdog and its emergency stop. Raises UsageError for an invalid URL, or if several rigs are
    found. A DeviceError is not raised: it becomes the report's last check.
    """
    device, profile = device or default_device(), profile or default_profile()
    done: list[tuple[str, Check]] = []
    opened = True
    try:
        for group, check in _checks(device, profile, Path(folder), arm):
            done.append((group, check))
            each(check)
    except DeviceError as error:
        opened = False
        cause = f"; likely cause: {error.cause}" if error.cause else ""
        found = f"{error.what.rstrip('.')}{cause}"
        check = Check("opening the rig", found, False, error.fix)
        done.append(("rig", check))
        each(check)
    return DoctorReport(device, tuple(done), opened)


def _checks(device: str, profile: Profile, folder: Path, arm: bool) -> Iterator[tuple[str, Check]]:
    url = check_url(device)
    driver = load_driver(url.scheme)
    with driver_errors(driver):
        ports = list(driver.examine(url))
    yield from (("port", check) for check in ports)
    yield from (("computer", check) for check in host.checks(profile))
    with realtime() as granted:
        # Measured with the priority that a flight gets.
        wake_up = host.wake_up(profile)
    yield from (("computer", check) for check in (*granted.checks, wake_up))
    yield from (("recordings", check) for check in recordings.checks(folder))
    with open_rig(device, profile) as rig, realtime():
        yield from (("rig", check) for check in link.checks(rig, profile))
        if arm:
            yield from (("armed", check) for check in armed.checks(rig, profile))
