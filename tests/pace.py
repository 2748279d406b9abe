"""What work costs, told so that a slower machine, or a busy one, says the same.

*Counted*: how many of Python's instructions a call executes, and how many functions it calls, those
of C among them. No clock has a part in it.

*Timed*: the least of several times, divided by how much longer than on the machine on which the
bounds were set a fixed piece of work takes here and now:

    cost = min(T) / max(1, min(T_Y) / Y_S)

with T_Y the times of the yardstick, taken in turn with T.
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
"""s that the yardstick takes on the machine on which the bounds were set"""


@dataclass
class Work:
    """What a call did."""

    instructions: int = 0
    calls: int = 0


def counted(call: Callable[[], object]) -> Work:
    """What ``call`` does in this thread."""
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
    work.calls -= 2  # ``call`` itself, and the call that ends this
    return work


def timed(
    call: Callable[[], object], times: int = 5, clock: Callable[[], float] = time.process_time
) -> float:
    """The cost of ``call`` in s of ``clock``, as it would be on the machine of the bounds."""
    took, yard = _in_turn(call, times, clock)
    return took / max(1.0, yard / Y_S)


def slower(times: int = 5, clock: Callable[[], float] = time.process_time) -> float:
    """How many times as long as there the yardstick takes here and now, and 1 at least."""
    return max(1.0, _in_turn(lambda: None, times, clock)[1] / Y_S)


def _in_turn(
    call: Callable[[], object], times: int, clock: Callable[[], float]
) -> tuple[float, float]:
    took, yard = [], []
    collects = gc.isenabled()
    gc.disable()  # it goes through all that other tests have left as well
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
    """Some of everything: Python's own instructions, small objects, arrays, bytes."""
    total = 0
    for k in range(250_000):
        total += k % 7
    rows = [_PACK(k, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0) for k in range(40_000)]
    zlib.crc32(b"".join(rows))
    np.cumsum(np.sort(_VALUES) * 2.0)
