"""Measures of the cost of a call that do not depend on the speed or load of the machine.

`counted`: the number of Python instructions and of function calls (C functions included). It uses
no clock.

`timed`: CPU time, scaled by the time of a fixed reference workload (the yardstick) on this machine:

    cost = min(T) / max(1, min(T_Y) / Y_S)

T: times of the call in s. T_Y: times of the yardstick in s, alternating with T. Y_S: time of the
yardstick on the machine on which the bounds of the tests were set.
"""

from __future__ import annotations

import gc
import struct
import sys
import time
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from types import FrameType
from typing import Any

import numpy as np

Y_S = 0.02
"""s of the yardstick on the machine on which the bounds of the tests were set"""


@dataclass
class Work:
    """Counts of a call."""

    instructions: int = 0
    calls: int = 0


def counted(call: Callable[[], object]) -> Work:
    """Python instructions and function calls of ``call`` in this thread."""
    work = Work()

    def trace(frame: FrameType, event: str, _: Any) -> Any:
        frame.f_trace_opcodes, frame.f_trace_lines = True, False
        work.instructions += event == "opcode"
        return trace

    def profile(frame: FrameType, event: str, _: Any) -> None:
        work.calls += event in ("call", "c_call")

    before = sys.gettrace(), sys.getprofile()
    sys.settrace(trace)
    sys.setprofile(profile)
    try:
        call()
    finally:
        sys.setprofile(before[1])
        sys.settrace(before[0])
    work.calls -= 2  # ``call`` itself, and the call that ends the profile
    return work


def timed(
    call: Callable[[], object], times: int = 5, clock: Callable[[], float] = time.process_time
) -> float:
    """The cost of ``call`` in s of ``clock``, scaled to the reference machine."""
    took, yard = _alternating(call, times, clock)
    return took / max(1.0, yard / Y_S)


def slower(times: int = 5, clock: Callable[[], float] = time.process_time) -> float:
    """Time of the yardstick on this machine over `Y_S`; 1 at least."""
    return max(1.0, _alternating(lambda: None, times, clock)[1] / Y_S)


def _alternating(
    call: Callable[[], object], times: int, clock: Callable[[], float]
) -> tuple[float, float]:
    took, yard = [], []
    collects = gc.isenabled()
    gc.disable()  # a collection also visits the objects of other tests
    try:
        for _ in range(times):
            start = clock()
            yardstick()
            between = clock()
            call()
            yard.append(between - start)
            took.append(clock() - between)
    finally:
        if collects:
            gc.enable()
    return min(took), min(yard)


_VALUES = np.random.default_rng(0).normal(size=400_000)
_PACK = struct.Struct("<8d").pack


def yardstick() -> None:
    """A mix of Python instructions, small objects, arrays and bytes."""
    total = 0
    for k in range(250_000):
        total += k % 7
    rows = [_PACK(k, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0) for k in range(40_000)]
    zlib.crc32(b"".join(rows))
    np.cumsum(np.sort(_VALUES) * 2.0)
