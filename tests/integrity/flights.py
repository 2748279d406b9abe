"""Flights of the emulated rig for the integrity checks, and changes applied to a recording."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np

from heli3dof.experiment.plan import load_plan, step_plan
from heli3dof.integrity import Fault, Kind, integrity
from heli3dof.recording.recording import Recording
from tests.flown import first_part, flown
from tests.profiles import profile

Change = Callable[[Recording], Recording]
STOPPING = (Kind.BAD_DATA, Kind.NOT_IDENTIFIABLE)


def flight(
    plan: str = "rich",
    hide: str = "",
    seed: int = 1201,
    until_s: float = 45.0,
    rate_hz: float = 250.0,
) -> Recording:
    """Return a flight from the table and back; ``run-step`` is a 10° step in roll.

    ``until_s``: a longer plan ends there, and the rig lands from there.
    """
    return _flown(plan, hide, seed, until_s, rate_hz)  # one form of the arguments for the cache


@lru_cache(maxsize=40)
def _flown(plan: str, hide: str, seed: int, until_s: float, rate_hz: float) -> Recording:
    whole = step_plan((10.0, None, None)) if plan == "run-step" else load_plan(plan)
    device = "mock:?speed=max" + (f"&hide={hide}" if hide else "")
    return flown(
        first_part(whole, until_s), device=device, seed=seed, profile=profile(rate_hz=rate_hz)
    )


def names(recording: Recording, *kinds: str) -> set[str]:
    """Return ``check`` or ``check.axis`` of each fault of these kinds; of all faults by default."""
    return {_name(f) for f in integrity(recording) if not kinds or f.kind in kinds}


def only(recording: Recording) -> Fault:
    """Return the only fault that is not a note."""
    (fault,) = (f for f in integrity(recording) if f.kind != Kind.NOTE)
    return fault


def _name(fault: Fault) -> str:
    return fault.check if fault.axis is None else f"{fault.check}.{fault.axis}"


def turned(axis: int) -> Change:
    """Return the change that reverses an encoder's sign."""
    return lambda r: with_angle(r, axis, -r.angle[:, axis])


def scaled(axis: int, k: float) -> Change:
    """Return the change that multiplies an axis's counts from the start angle by k."""

    def change(r: Recording) -> Recording:
        grid = abs(float(r.profile.encoder.rad_per_count[axis]))
        q = r.angle[:, axis]
        return with_angle(r, axis, q[0] + np.round(k * (q - q[0]) / grid) * grid)

    return change


def with_angle(r: Recording, axis: int, values: np.ndarray) -> Recording:
    angle = r.angle.copy()
    angle[:, axis] = values
    return replace(r, angle=angle)


def with_voltage(r: Recording, factor: float) -> Recording:
    """Return r with applied and commanded voltages multiplied by the factor."""
    return replace(r, voltage=factor * r.voltage, voltage_cmd=factor * r.voltage_cmd)


def swapped(r: Recording) -> Recording:
    """Return r with the voltages of front and back motor swapped."""
    return replace(r, voltage=r.voltage[:, ::-1], voltage_cmd=r.voltage_cmd[:, ::-1])


def with_time(r: Recording, t: np.ndarray) -> Recording:
    """Return r with time stamps t and without the device's clock, as in an imported log."""
    return replace(r, t=t, channels={})
