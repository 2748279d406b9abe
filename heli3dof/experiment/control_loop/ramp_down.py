"""The end of every flight: the motors ramped to zero, every period of the ramp recorded.

    V[i] = V_start · (1 − i/n),  i = 1 … n,  n = ramp time / dt

    V_start = V_last   where |V_last,front − V_o| ≤ ½ V_h and |V_last,back − V_o| ≤ ½ V_h
    V_start = 0        elsewhere,                             V_h = max(|V_o|, v_max/8)

A ramp sets down an arm that its thrust carries. From voltages far from the hover voltage a ramp
throws the arm (24 V after a wrong encoder sign: up to 100°) or drives it into the table, so both
motors go to zero at once. The law reads no angle, because the encoders may be why the flight ends.
`make bench TOPIC=ramp_down` compares it with other laws.

The ramp skips missed and lost periods too: it takes its time, no longer. It begins at V_last,
however long that stood. Where the ramp cannot be flown (the device does not answer, or a second
signal asks for it) the device is stopped at once. A device that stops by itself on the way is left
alone, and its report is kept: samples are recorded for as long as the ramp would have taken.

The safety monitors judge the ramp, too. The ramp at a plan's end is slow (``landing_s``). A report
of a monitor or of the recorder, or a request to end the flight, shortens the rest of it: from there
the last voltages reach zero within the ramp time of an interrupted flight. While the monitors state
that the arm must still fall, zero volts are held for `FALL_S` at most.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from heli3dof.errors import DeviceError
from heli3dof.experiment.control_loop.rig_exchange import Pacer
from heli3dof.experiment.control_loop.stop_reasons import STOPPED, explain
from heli3dof.recording.row import Row
from heli3dof.rig.interface import Flags, Sample
from heli3dof.rig.profile import Motor

HOVER_BAND = 0.5
"""Share of the hover voltage by which a motor's last voltage may differ from it and be ramped. A
rig whose gain and trim torque each differ by 20 % from the profile hovers at 0.67 to 1.5 V_o. An
arm at rest that a ramp from κ times its hover voltage takes over climbs by (2/3) (κ − 1)³/κ² ·
T_g/J_roll · ramp time²: 0.7° at κ = 1.5, 73°/s² and 0.5 s"""
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
    asked: str | None = None
    """Who asked on the way to end the flight"""
    error: BaseException | None = None
    """What kept it from being flown"""
    ramped: bool = False
    """True where it began at the last voltages; False where the motors went to zero at once"""


def ramp_start(last: tuple[float, float], motor: Motor) -> tuple[float, float]:
    """V_start (front, back) in V of the ramp to zero, from the last voltages sent in V."""
    most = HOVER_BAND * motor.hover_V
    hovers = all(abs(volts - motor.V_o) <= most for volts in last)
    return last if hovers else (0.0, 0.0)


def land(
    pacer: Pacer,
    sample: Sample | None,
    steps: int,
    motor: Motor,
    keep: Keep,
    at_once: Callable[[], str | None],
    known: int = 0,
    monitor: Callable[[Sample, tuple[float, float]], str | None] = lambda sample, voltage: None,
    must_still_fall: Callable[[], bool] = lambda: False,
    asked_to_end: Callable[[], str | None] = lambda: None,
    hurried_steps: int | None = None,
) -> Landing:
    """Ramp to zero in ``steps`` periods from the last sample (None: the device does not answer).

    ``motor`` is the profile's: its V_o and v_max decide where the ramp starts (`ramp_start`).
    ``known`` flags are already part of the reason why the flight ends. ``monitor`` judges each
    sample and the voltage (V) that was sent before it; its first report is kept. From that report
    on, or from a reason that ``asked_to_end`` returns, the ramp takes ``hurried_steps`` at most.
    """
    if sample is None:
        pacer.stop("the device did not answer")
        return Landing(False)
    # A device that stands stopped needs no ramp; its rows show that it stays so.
    start = (0.0, 0.0) if sample.flags & Flags.ESTOP else ramp_start(pacer.sent, motor)
    ramped = start != (0.0, 0.0)
    told = int(sample.flags)
    i = skipped = 0
    tripped = asked = None
    voltage = start
    hurried = False
    most = steps + round(FALL_S / pacer.dt)
    try:
        while i < steps or (i < most and not hurried and must_still_fall()):
            now = at_once()
            if now is not None:
                pacer.stop(now)
                return Landing(False, now, stopped=True)
            asked = asked or asked_to_end()
            if not hurried and (asked is not None or tripped is not None):
                hurried = True
                if hurried_steps is not None and hurried_steps < steps - i:
                    start, i, steps = voltage, 0, hurried_steps
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
    return Landing(True, ramped=ramped, tripped=tripped, asked=asked)


class Kept:
    """Hands rows on until that fails: a broken recorder must not keep the motors from zero."""

    def __init__(self, append: Callable[[Row], None]) -> None:
        self._append: Callable[[Row], None] | None = append
        self.failure: Exception | None = None
        """Why the recorder takes no more"""

    @property
    def problem(self) -> str | None:
        """The same in words; None while it takes rows."""
        return None if self.failure is None else f"{type(self.failure).__name__}: {self.failure}"

    def __call__(self, row: Row) -> None:
        if self._append is not None:
            try:
                self._append(row)
            except Exception as problem:
                self._append, self.failure = None, problem
