"""The end of every flight: the motors ramped to zero, every period of the ramp recorded.

    V[i] = V_last · (1 − i/n),  i = 1 … n,  n = ramp time / dt

Periods that are missed or lost on the way are skipped here too: the ramp takes its time, no longer.
Those before it are not of it: it begins at V_last, however long that stood. Where it cannot be
flown (the device does not answer, or a second signal asks for it) the device is stopped at once. A
device that stops by itself on the way is left alone, and what it says is kept: samples are recorded
for as long as the ramp would have taken.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from heli3dof.errors import DeviceError
from heli3dof.experiment.pacer import Pacer
from heli3dof.experiment.stopped import STOPPED, explain
from heli3dof.recording.row import Row
from heli3dof.rig.port import Flags, Sample

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
    error: BaseException | None = None
    """What kept it from being flown"""


def land(
    pacer: Pacer,
    sample: Sample | None,
    steps: int,
    keep: Keep,
    at_once: Callable[[], str | None],
    known: int = 0,
) -> Landing:
    """Ramp to zero in ``steps`` periods from the last sample (None: the device does not answer).

    ``known`` flags have been said already to be why the flight ends.
    """
    if sample is None:
        pacer.stop("the device did not answer")
        return Landing(False)
    # A device that stands stopped needs no ramp; its rows show that it stays so.
    start = (0.0, 0.0) if sample.flags & Flags.ESTOP else pacer.sent
    told = int(sample.flags)
    i = skipped = 0
    try:
        while i < steps:
            now = at_once()
            if now is not None:
                pacer.stop(now)
                return Landing(False, now, stopped=True)
            i = min(steps, i + 1 + skipped)
            voltage = (start[0] * (1 - i / steps), start[1] * (1 - i / steps))
            before, lateness = sample, pacer.lateness
            sample = pacer.exchange(before, voltage)
            skipped = pacer.skipped
            told |= int(sample.flags)
            keep(before, voltage, lateness, sample)
    except BaseException as problem:
        said = problem.what if isinstance(problem, DeviceError) else str(problem)
        why = f"the ramp to zero failed: {said}"
        pacer.stop(why)
        return Landing(False, why, error=problem)
    by_itself = explain(told & STOPPED & ~known, pacer.device_cause)
    return Landing(True) if by_itself is None else Landing(False, by_itself, stopped=True)


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
