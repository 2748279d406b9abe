"""Is a driver's sample made of numbers? Counts and flags whole ones, times finite ones.

A NaN compares false with everything, so ``min(max(v, −v_max), v_max)`` of one may be v_max. A
sample that holds one must therefore never reach a controller. Voltages and currents may be NaN:
"not measured"; nothing is computed from them in flight.
"""

from __future__ import annotations

from math import isfinite
from operator import index
from typing import Any

from heli3dof.rig.interface import Sample

LARGEST_COUNT = 1 << 62
"""Counts: what a signed 64-bit integer holds, with room for a difference"""


def unreadable(sample: Any) -> str | None:
    """The first field that is no number, in words; None for a sound sample. About 1 µs."""
    if not isinstance(sample, Sample):
        return f"{sample!r} is no Sample"
    for name, value in (("sequence", sample.sequence), ("flags", sample.flags)):
        try:
            index(value)
        except TypeError:
            return f"{name} = {value!r} is not a whole number"
    counts: tuple[Any, ...] = sample.counts
    for axis, count in zip(("roll", "pitch", "yaw"), counts, strict=False):
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
            good = isfinite(time_s)
        except TypeError:
            good = False
        if not good:
            return f"{name} = {time_s!r} is not a time"
    return None
