"""The end of every flight: the motors ramped to zero, every period of the ramp recorded.

    V[i] = V_last · (1 − i/n),  i = 1 … n,  n = ramp time / dt

Periods that are missed or lost on the way are skipped here too: the ramp takes its time, no longer.
Those before it are not of it: it begins at V_last, however long that stood. Where it cannot be
flown (the device does not answer, or a second signal asks for it) the device is stopped at once. A
device that stops by itself on the way is left alone, and what it says is kept: samples are recorded
for as long as the ramp would have taken.

The safety monitors judge the ramp, too. What they report does not change it, for the voltages fall
already. While they say that the arm must still fall, zero volts are held for `FALL_S` at most.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from heli3dof.errors import DeviceError
from heli3dof.experiment.pacer import Pacer
from heli3dof.experiment.stopped import STOPPED, explain
from heli3dof.recording.row import Row
from heli3dof.rig.port import Flags, Sample

FALL_S = 2.0
"""s: from any height an arm without thrust is on the table by then (1 rad at 1 rad/s²)"""
Keep = Callable[[Sample, tuple[float, float], float, Sample], None]
"""Keeps a period: the sample that opened it, V, its lateness in s, the sample after."""


@dataclass(frozen=True)
class Landing:
    """How the ramp went."""

    landed: bool
    """True when it was flown to zero"""
    why: str = ""
    """Why the device was stopped at once instead"""
    stopped: bool = False
    """True where somebody asked for that, or the device did it by itself"""
    tripped: str | None = None
    """What a safety monitor reported on the way"""
    error: BaseException | None = None
    """What kept it from being flown"""


def land(
    pacer: Pacer,
    sample: Sample | None,
    steps: int,
    keep: Keep,
    at_once: Callable[[], str | None],
    known: int = 0,
    monitor: Callable[[Sample, tuple[float, float]], str | None] = lambda sample, voltage: None,
    must_still_fall: Callable[[], bool] = lambda: False,
) -> Landing:
    """Ramp to zero in ``steps`` periods from the last sample (None: the device does not answer).

    ``known`` flags are already part of the reason why the flight ends. ``monitor`` judges each
    sample and the voltage (V) that was sent before it; its first report is kept.
    """
    if sample is None:
        pacer.stop("the device did not answer")
        return Landing(False)
    # A device that stands stopped needs no ramp; its rows show that it stays so.
    start = (0.0, 0.0) if sample.flags & Flags.ESTOP else pacer.sent
    told = int(sample.flags)
    i = skipped = 0
    tripped: str | None = None
    most = steps + round(FALL_S / pacer.dt)
    try:
        while i < steps or (i < most and tripped is None and must_still_fall()):
            now = at_once()
            if now is not None:
                pacer.stop(now)
                return Landing(False, now, stopped=True)
            i += 1 + skipped
            share = max(0.0, 1 - i / steps)
            voltage = (start[0] * share, start[1] * share)
            before, lateness = sample, pacer.lateness
            sample = pacer.exchange(before, voltage)
            skipped = pacer.skipped
            told |= int(sample.flags)
            keep(before, voltage, lateness, sample)
            tripped = tripped or monitor(sample, voltage)
    except BaseException as problem:
        said = problem.what if isinstance(problem, DeviceError) else str(problem)
        why = f"the ramp to zero failed: {said}"
        pacer.stop(why)
        return Landing(False, why, error=problem)
    by_itself = explain(told & STOPPED & ~known, pacer.device_cause)
    if by_itself is not None:
        return Landing(False, by_itself, stopped=True)
    return Landing(True, tripped=tripped)


class Kept:
    """Hands rows on until that fails: a broken recorder must not keep the motors from zero."""

    def __init__(self, append: Callable[[Row], None]) -> None:
        self._append: Callable[[Row], None] | None = append

    def __call__(self, row: Row) -> None:
        if self._append is not None:
            try:
                self._append(row)
            except Exception:
                self._append = None
