"""Measures the encoder counts at the rest angles, while the rig stands still at known angles.

    counts_at_rest = median(count) − (angle now − rest angle) · counts per revolution / 2π

rounded to whole counts; both angles are in rad. The rig is not at rest if an axis moves by more
than both `STILL_DEG` and `STILL_COUNTS` during the measurement.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from math import degrees, radians
from pathlib import Path

from heli3dof.axes import AXES
from heli3dof.errors import CheckFailed, SafetyTrip, UsageError
from heli3dof.rig.calibration import (
    COUNTS_AT_POWER_UP,
    Calibration,
    Counts,
    store_calibration,
)
from heli3dof.rig.drivers import default_device, is_private
from heli3dof.rig.interface import Flags, Rig
from heli3dof.rig.profile import Profile, default_profile
from heli3dof.rig.session.open_exclusive import open_rig

STILL_DEG = 0.2
"""°: largest range of an angle at rest; a rig that swings moves further"""
STILL_COUNTS = 2
"""counts: largest range at rest; the reading of an encoder between two counts alternates by one"""
EVERY_S = 0.01
"""s between readings"""
MEASURE_S = 1.0
"""s for which `zero` reads the encoders"""


def calibrate(
    rig: Rig,
    profile: Profile,
    device: str,
    angles_deg: tuple[float | None, float | None, float | None],
    seconds: float,
) -> Calibration:
    """Read the encoders of a rig at rest for ``seconds`` s; return its calibration.

    ``angles_deg``: roll, pitch and yaw at which the rig stands, in degrees; None: the axis is at
    its rest angle. ``device``: the rig's URL. Raises SafetyTrip if the rig is armed, CheckFailed if
    the rig moved.
    """
    columns = list(zip(*_readings(rig, seconds), strict=True))
    per_count = profile.encoder.rad_per_count
    rest = profile.encoder.rest_rad
    at_rest = []
    for i, axis in enumerate(AXES):
        moved = max(columns[i]) - min(columns[i])
        moved_deg = abs(degrees(moved * per_count[i]))
        if moved > STILL_COUNTS and moved_deg > STILL_DEG:
            raise CheckFailed(
                f"The rig is not at rest: {axis} moved by {moved_deg:.2f}° ({moved} counts).",
                cause="it still swings, someone touches it, or the encoder picks up noise.",
                fix="let it come to rest; heli3dof monitor shows the angles",
            )
        angle = angles_deg[i]
        offset = 0.0 if angle is None else (radians(angle) - rest[i]) / per_count[i]
        at_rest.append(round(statistics.median(columns[i])) - round(offset))
    identity = rig.identity
    return Calibration(
        identity.serial,
        identity.boot,
        identity.counts_per_rev,
        (at_rest[0], at_rest[1], at_rest[2]),
        datetime.now(UTC).isoformat(timespec="seconds"),
        device,
        identity.started_s,
    )


def _readings(rig: Rig, seconds: float) -> Iterator[Counts]:
    """Yield the encoder counts of a rig for ``seconds`` s. Raises SafetyTrip for an armed rig."""
    until = time.monotonic() + seconds
    while True:
        sample = rig.read()
        if sample.flags & Flags.ENABLED:
            raise SafetyTrip(
                "The rig is armed: its motors may turn.",
                cause="another program controls it, or left it armed.",
                fix="heli3dof estop",
            )
        yield sample.counts
        if time.monotonic() >= until:
            return
        time.sleep(EVERY_S)


@dataclass(frozen=True)
class ZeroResult:
    """Result of `zero`: the measured calibration, and how it differs from the previous one."""

    device: str
    calibration: Calibration
    shift_deg: tuple[float, float, float]
    """Roll, pitch, yaw in degrees: new minus previous rest counts, times the angle per count"""
    stored: Path | None
    """File of the calibration; None if not stored: ``store`` is False, or the rig is emulated"""
    emulated: bool


def zero(
    device: str | None = None,
    profile: Profile | None = None,
    *,
    angles_deg: tuple[float | None, float | None, float | None] = (None, None, None),
    store: bool = True,
) -> ZeroResult:
    """Measure the encoder counts of a rig at rest and store them. Moves nothing.

    ``device``: the rig's URL. The default, as on the command line, is the URL in the environment
    variable HELI3DOF_DEVICE. Without this variable, it is the real rig if exactly one is found, and
    the emulated rig if none is found. ``angles_deg``: roll, pitch and yaw at which the rig stands
    now, in degrees; None: the axis's rest angle. ``store``: False stores nothing. Raises UsageError
    for an angle outside the profile's limits or if several rigs are found, DeviceError if the rig
    cannot be opened or read, SafetyTrip if the rig is armed, and CheckFailed if the rig moves.
    """
    device, profile = device or default_device(), profile or default_profile()
    for axis, angle, (low, high) in zip(AXES, angles_deg, profile.limits.ranges_deg, strict=True):
        if angle is not None and not low <= angle <= high:
            raise UsageError(
                f"The rig cannot stand at {axis} = {angle:g}°: the profile permits {low:g}° to "
                f"{high:g}°.",
                cause="a typing error, or the profile's [limits] are too narrow.",
                fix="heli3dof zero with the angle in degrees at which the rig stands now",
            )
    with open_rig(device, profile) as rig:
        before, rig.rest = rig.rest, COUNTS_AT_POWER_UP  # raw counts of the device
        measured = calibrate(rig, profile, device, angles_deg, MEASURE_S)
    roll, pitch, yaw = (
        degrees((now - then) * per_count)
        for now, then, per_count in zip(
            measured.counts_at_rest,
            before.counts_at_rest,
            profile.encoder.rad_per_count,
            strict=True,
        )
    )
    emulated = is_private(device)
    stored = store_calibration(measured) if store and not emulated else None
    return ZeroResult(device, measured, (roll, pitch, yaw), stored, emulated)
