"""Checks that counts, flags and times in a driver's sample are numbers.

A NaN compares false with everything. So limiting a NaN to ±v_max may return v_max or −v_max,
depending on the order of the arguments of min and max. Therefore no NaN may reach the controller.
Voltages and currents may be NaN, "not measured": the control law does not use them.
"""

from __future__ import annotations

from math import isfinite
from operator import index
from typing import Any

from heli3dof.axes import AXES
from heli3dof.errors import DeviceError
from heli3dof.rig.interface import Sample
from heli3dof.rig.trip import Trip

LARGEST_COUNT = 1 << 62
"""counts: half the range of a signed 64-bit integer, so that no difference overflows"""
_CAUSE = "a mistake in the driver, or a reading that failed and was passed on."
_FIX = "python -m heli3dof.rig.conformance URL, which examines a driver"


def check_sample(sample: Any) -> None:
    """Raise DeviceError if a field of the sample is not a valid number (`sample_problem`)."""
    trip = unusable_sample(sample)
    if trip is not None:
        raise DeviceError(f"{trip[0].upper()}{trip[1:]}.", cause=trip.cause, fix=trip.fix)


def unusable_sample(sample: Any) -> Trip | None:
    """Return why the flight must end if a field of the sample is not a valid number, else None."""
    problem = sample_problem(sample)
    if problem is None:
        return None
    return Trip(f"the rig's driver gave a sample that cannot be used: {problem}", _CAUSE, _FIX)


def sample_problem(sample: Any) -> str | None:
    """Return why a sample is not valid, as text; None if it is valid.

    The text names the first invalid field and its value. The sequence number, the three counts and
    the flags must be whole numbers. The times must be finite. The check takes about 1 µs.
    """
    if not isinstance(sample, Sample):
        return f"{sample!r} is no Sample"
    for name, value in (("sequence", sample.sequence), ("flags", sample.flags)):
        try:
            index(value)
        except TypeError:
            return f"{name} = {value!r} is not a whole number"
    counts: tuple[Any, ...] = sample.counts
    for axis, count in zip(AXES, counts, strict=False):
        try:
            in_range = abs(index(count)) < LARGEST_COUNT
        except TypeError:
            in_range = False
        if not in_range:
            return f"the {axis} count {count!r} is not a whole number"
    if len(counts) != 3:
        return f"{len(counts)} counts instead of 3"
    for name, time_s in (
        ("device_time_s", sample.device_time_s),
        ("host_time_s", sample.host_time_s),
    ):
        try:
            finite = isfinite(time_s)
        except TypeError:
            finite = False
        if not finite:
            return f"{name} = {time_s!r} is not a time"
    return None
