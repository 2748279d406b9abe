"""Opens a rig in a session: the rig is locked, and other processes can stop and observe it.

    with open_rig("serial:///dev/ttyACM0", profile) as rig:
        sample = rig.read()

Every command of heli3dof that moves or reads a rig opens it with `open_rig`. A program that instead
calls `heli3dof.rig.drivers.open_driver` does not lock the rig. ``heli3dof estop`` then cannot
request a stop from this program; it can only send a stop to the device.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from math import degrees, isfinite
from typing import Any

from heli3dof.axes import AXES, MOTORS
from heli3dof.errors import DeviceError
from heli3dof.rig.calibration import COUNTS_AT_POWER_UP, rest_counts_of
from heli3dof.rig.drivers import is_private, open_driver
from heli3dof.rig.interface import Flags, Sample
from heli3dof.rig.profile import Profile
from heli3dof.rig.session.known_devices import remember
from heli3dof.rig.session.server import Session
from heli3dof.rig.session.stoppable_rig import StoppableRig


@contextmanager
def open_rig(
    device: str,
    profile: Profile,
    *,
    doing: str | None = None,
    also: Callable[[], Mapping[str, Any]] = dict,
    began_ns: int | None = None,
) -> Iterator[StoppableRig]:
    """Context manager: open and lock the rig; close it, with the motors at zero, at the end.

    An example that commands 7 V for 0.2 s:

    >>> import heli3dof as h3
    >>> profile = h3.default_profile()
    >>> with h3.open_rig("mock:?speed=max", profile) as rig:
    ...     sample = rig.arm()
    ...     for k in range(1, 101):
    ...         sample = rig.exchange(h3.Command(k, 7.0, 7.0), sample.host_time_s + profile.dt)
    >>> sample.v_applied
    (7.0, 7.0)

    No safety monitor runs. There are no limits of angles, rates or slew, and no ramp to zero at the
    end. `heli3dof.fly_plan` has all of these. Only three things protect the rig:

    - ``exchange`` clips the voltages to ±``motor.v_max`` of the profile.
    - The user can stop the motors with ``heli3dof estop``.
    - The device's watchdog stops the motors if no command arrives.

    ``device``: the rig's URL. ``doing``: what the session does, for messages; default: the command
    line. ``also`` returns entries to add to the state that other processes read. ``began_ns``: a
    time in ns on the monotonic clock. If an emergency stop came after this time, the rig cannot be
    armed. The default, usually the start of this program, is the result of
    `heli3dof.rig.session.stop_stamp.command_began_ns`.

    The opened rig's counts are zero at its rest angles. Its ``rest.note`` states what the user
    should know about this zero.

    Raises DeviceError if the rig is missing, not permitted, in use by another session, or without a
    serial number.
    """
    with Session(device, private=is_private(device), doing=doing, began_ns=began_ns) as session:
        opened = open_driver(device, profile)
        try:
            if not opened.identity.serial.strip():
                raise DeviceError(
                    f"{device}: the device has no serial number.",
                    cause="its firmware leaves the field empty; rest angles and locks need it.",
                    fix="give it one in its firmware; docs/reference/protocol.md, IDENTITY",
                )
            session.claim(opened.identity)
        except BaseException:
            opened.close()  # it was never armed: another session's rig stays as it is
            raise
        if not session.private:
            remember(device, opened.identity.serial)
        rest = COUNTS_AT_POWER_UP if session.private else rest_counts_of(opened.identity)
        rig = StoppableRig(opened, session, rest, profile.motor.v_max)
        try:
            session.state = lambda: {**state_of(rig, profile), **also()}
            yield rig
        finally:
            rig.close()


def state_of(rig: StoppableRig, profile: Profile) -> dict[str, Any]:
    """Return a rig's identity and last sample as a dict that other processes can request."""
    sample, identity = rig.last, rig.identity
    about = {"driver": identity.driver, "serial": identity.serial, "boot": identity.boot}
    if sample is None:
        return about
    return {**about, **reading(sample, profile)}


def reading(sample: Sample, profile: Profile) -> dict[str, Any]:
    """Return a sample as a dict: angles (°), voltages (V), currents (A), times (s), flag names."""
    rest, per_count = profile.encoder.rest_rad, profile.encoder.rad_per_count
    values: dict[str, Any] = {
        f"{axis}_deg": degrees(rest[i] + sample.counts[i] * per_count[i])
        for i, axis in enumerate(AXES)
    }
    values |= {f"{axis}_counts": sample.counts[i] for i, axis in enumerate(AXES)}
    values |= {f"v_{motor}_V": sample.v_applied[i] for i, motor in enumerate(MOTORS)}
    for motor, current in zip(MOTORS, sample.current, strict=True):
        values[f"i_{motor}_A"] = current if isfinite(current) else None
    return values | {
        "device_time_s": sample.device_time_s,
        "host_time_s": sample.host_time_s,
        "sequence": sample.sequence,
        "flags": [flag.name for flag in Flags if sample.flags & flag],
    }
