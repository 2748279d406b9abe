"""Takes the motors to zero volts at the end of a flight; the loop records each control period.

    V[i] = V_start · (1 − i/n),  i = 1 … n,  n = ramp time / dt

    V_start = V_last   if |V_last,front − V_o| ≤ ½ V_h and |V_last,back − V_o| ≤ ½ V_h
    V_start = 0        otherwise
    V_h = max(|V_o|, v_max/8)

V: a motor's voltage (V); i: control periods of length dt since the start; V_last: last voltages
sent; V_o: hover voltage of each motor; v_max: the amplifier's limit.

From voltages near the hover voltage, a ramp sets the arm down. From other voltages, a ramp would
drive the arm into the table or throw it upwards. (With a wrong encoder sign the controller may end
at 24 V; a ramp from there throws the arm by up to 100°.) In this case, the loop sets both motors to
zero immediately, without a ramp. V does not depend on the angles, because a faulty encoder may have
ended the flight. Comparison with other laws: `make bench TOPIC=ramp_down`.

* Control periods that the loop skipped count as periods of the ramp, so they do not lengthen it.
* If the device does not answer, or if a second Ctrl-C arrives, the loop stops the device
  immediately.
* If the device stops on its own, the loop goes on recording its samples for the time of the ramp.
* After a completed plan the ramp is slow (``landing_s``), and the safety monitors stay active
  (`Supervision`). Three events shorten the rest of the ramp to at most ``ramp_down_s``: a report of
  a monitor, a failure of the recorder, or a request to end.
* If none of these events occurred, the loop checks the roll encoder at the end of the ramp. A
  working encoder shows the arm fall. An encoder that reads a constant angle above the table may be
  dead. Then the loop holds zero volts until the reading changes, for at most `FALL_S`.
* If the device still reports an output voltage above `ZERO` · V_h after the ramp, the loop holds
  zero volts for at most `ZERO_S`. If the voltage stays above this limit, the loop stops the device.
  The flight's outcome is then ``tripped`` (ended by a safety trip).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from heli3dof.errors import DeviceError
from heli3dof.experiment.control_loop.control_period import motor_voltage
from heli3dof.experiment.control_loop.rig_exchange import RigExchange
from heli3dof.experiment.control_loop.stop_reasons import STOPPED
from heli3dof.recording.row import Row
from heli3dof.rig.interface import Flags, Sample
from heli3dof.rig.profile import Motor
from heli3dof.rig.trip import Trip

HOVER_BAND = 0.5
"""Largest difference between a last voltage and V_o at which a ramp starts, as a share of V_h. A
rig whose gain and trim torque each differ by 20 % from the profile hovers at 0.67 to 1.5 V_o. An
arm at rest, ramped from κ times its hover voltage, climbs by (2/3) (κ − 1)³/κ² · T_g/J_roll · ramp
time²: 0.7° at κ = 1.5, T_g/J_roll = 73°/s² and a ramp of 0.5 s"""
FALL_S = 2.0
"""s within which an arm without thrust reaches the table from any height (1 rad at 1 rad/s²)"""
ZERO = 0.1
"""Largest output that counts as zero volts after the ramp, as a share of V_h: more than the error
of a measured output, too little to move the arm"""
ZERO_S = 0.1
"""s after the ramp within which the output must be zero: the latency of a slow link"""
Pair = tuple[float, float]
Record = Callable[[Sample, Pair, float, Sample], None]
"""Records a period, given its first sample, the voltages sent (V), the lateness of this sample (s)
and the next sample"""


@dataclass(frozen=True)
class Supervision:
    """Callbacks that may shorten or extend the slow ramp to zero after a completed plan."""

    monitor: Callable[[Sample, Pair], str | None]
    """Judges each sample and the voltages (V) sent before it; returns why to shorten, or None"""
    reason_to_shorten: Callable[[], str | None]
    """Returns why to shorten: a request of the user or a failure of the recorder; else None"""
    awaits_fall: Callable[[], bool]
    """Returns True if the arm must fall, but the roll count is constant above the table"""
    shortened_steps: int
    """Largest number of remaining control periods of a ramp that is shortened"""


@dataclass(frozen=True)
class RampDown:
    """Result of a ramp to zero: whether it finished, and what cut it short."""

    finished: bool
    """True if the last command was zero volts and the device carried it out: its output is zero"""
    reason: str = ""
    """Why the ramp was not finished"""
    stopped: bool = False
    """True if the loop stopped the device (on request, or because its output was not zero after the
    ramp), or if the device stopped on its own"""
    tripped: str | None = None
    """First report of a safety monitor during the ramp"""
    requested: str | None = None
    """Reason of a request to end that came during the ramp"""
    error: BaseException | None = None
    """The exception that ended the ramp"""
    ramped: bool = False
    """True if the ramp began at the last voltages; False if the motors went to zero at once"""


def ramp_start(last: Pair, motor: Motor) -> Pair:
    """Return V_start of the module's docstring (front, back); ``last``: V_last (both in V)."""
    most = HOVER_BAND * motor.hover_V
    hovers = all(abs(volts - motor.V_o) <= most for volts in last)
    return last if hovers else (0.0, 0.0)


class _Schedule:
    """Computes the voltages of a ramp to zero, as the module's docstring defines them."""

    def __init__(self, start: Pair, steps: int) -> None:
        self.voltage = self._start = start
        self._i, self._n = 0, steps

    @property
    def left(self) -> int:
        """Return the number of control periods until the ramp's end; negative after it."""
        return self._n - self._i

    def advance(self, periods: int) -> Pair:
        self._i += periods
        share = max(0.0, 1 - self._i / self._n)
        self.voltage = (self._start[0] * share, self._start[1] * share)
        return self.voltage

    def shorten(self, steps: int) -> None:
        """Shorten the ramp so that it reaches zero in at most ``steps`` more control periods."""
        if steps < self.left:
            self._start, self._i, self._n = self.voltage, 0, steps


def ramp_to_zero(
    exchange: RigExchange,
    sample: Sample | None,
    steps: int,
    motor: Motor,
    record: Record,
    stop_without_ramp: Callable[[], str | None],
    *,
    known: int = 0,
    supervision: Supervision | None = None,
) -> RampDown:
    """Ramp to zero in ``steps`` control periods; return the result, which includes any exception.

    Args:
        exchange: sends the commands and returns the samples.
        sample: the last sample; None if the device does not answer. The function then only
            requests an emergency stop of the device.
        motor: the profile's motors; V_o and v_max decide where the ramp starts (`ramp_start`).
        record: records each period.
        stop_without_ramp: returns the reason to stop the device at once, without the rest of the
            ramp; None if there is no reason.
        known: device flags that ended the flight; the function does not report them again.
        supervision: may shorten or extend the ramp; None if the plan was not completed.
    """
    if sample is None:
        exchange.stop("the device did not answer")
        return RampDown(False)
    # A stopped device needs no ramp; its rows show that it stays stopped.
    start = (0.0, 0.0) if sample.flags & Flags.ESTOP else ramp_start(exchange.sent, motor)
    ramp = _Schedule(start, steps)
    flags = int(sample.flags)
    skipped = 0
    tripped = requested = None
    hurried = False
    fall_steps, zero_steps = round(FALL_S / exchange.dt), round(ZERO_S / exchange.dt)
    try:
        while (
            ramp.left > 0
            or (ramp.left > -zero_steps and not _is_zero(sample, motor))
            or (
                supervision is not None
                and not hurried
                and ramp.left > -fall_steps
                and supervision.awaits_fall()
            )
        ):
            if (reason := stop_without_ramp()) is not None:
                exchange.stop(reason)
                return RampDown(False, Trip.first(tripped, reason) or reason, stopped=True)
            if supervision is not None:
                requested = requested or supervision.reason_to_shorten()
                if not hurried and (requested is not None or tripped is not None):
                    hurried = True
                    ramp.shorten(supervision.shortened_steps)
            voltage = ramp.advance(1 + skipped)
            before, lateness = sample, exchange.time.lateness
            sample = exchange.exchange(before, voltage)
            skipped = exchange.time.skipped
            flags |= int(sample.flags)
            record(before, voltage, lateness, sample)
            if supervision is not None:
                tripped = tripped or supervision.monitor(sample, voltage)
    except BaseException as problem:
        what = problem.what if isinstance(problem, DeviceError) else str(problem)
        reason = f"the ramp to zero failed: {what}"
        exchange.stop(reason)
        return RampDown(False, reason, error=problem)
    device_stop = exchange.explain(flags & STOPPED & ~known)
    if not _is_zero(sample, motor):
        front, back = sample.v_applied
        still_on = Trip(
            f"after the ramp to zero the device still reported an output of {front:.2f} and "
            f"{back:.2f} V, so it was stopped",
            "the amplifier ignores the commands, or its samples are old.",
            "press the amplifier's button if a rotor still turns; then heli3dof doctor",
        )
        exchange.stop(still_on)
        return RampDown(False, Trip.first(device_stop, tripped, still_on) or "", stopped=True)
    if device_stop is not None:
        return RampDown(False, device_stop, stopped=True)
    return RampDown(True, ramped=start != (0.0, 0.0), tripped=tripped, requested=requested)


def _is_zero(sample: Sample, motor: Motor) -> bool:
    """Return True if the output voltages of both motors are at most `ZERO` · V_h in magnitude.

    V_h is the size of the hover voltage (`Motor.hover_V`). An output voltage that the device does
    not report counts as zero.
    """
    volts = motor_voltage(sample, (0.0, 0.0))
    return max(map(abs, volts)) <= ZERO * motor.hover_V


class GuardedRecorder:
    """Passes rows to a recorder; ignores all rows after the recorder's first exception.

    So the recorder's failure does not interrupt the ramp to zero.
    """

    def __init__(self, append: Callable[[Row], None]) -> None:
        self._append = append
        self.failure: Exception | None = None
        """The recorder's exception"""

    @property
    def problem(self) -> str | None:
        """Return the recorder's exception as text; None while the recorder works."""
        return None if self.failure is None else f"{type(self.failure).__name__}: {self.failure}"

    def __call__(self, row: Row) -> None:
        if self.failure is None:
            try:
                self._append(row)
            except Exception as problem:
                self.failure = problem
