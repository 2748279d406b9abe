"""The flight loop: sample, controller, envelope, command; once per control period.

    sample k → angles k → V[k] = controller(angles k, references k) → held until sample k+1

Deadlines are absolute; the loop skips periods that are over and never makes up for them
(`heli3dof.experiment.control_loop.timekeeping`). At the end of every flight the loop takes the
motor voltages to zero (`heli3dof.experiment.control_loop.ramp_down`): by a ramp if they are near
the hover voltage, else at once. The loop also records the periods of the ramp.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace

from heli3dof.errors import DeviceError
from heli3dof.experiment.control_loop.control_period import Period, motor_voltage
from heli3dof.experiment.control_loop.outcome import Ending, Outcome, Tally, link_counts
from heli3dof.experiment.control_loop.ramp_down import (
    GuardedRecorder,
    RampDown,
    Supervision,
    ramp_to_zero,
)
from heli3dof.experiment.control_loop.realtime_priority import Realtime, quiet_interpreter, realtime
from heli3dof.experiment.control_loop.rig_exchange import RigExchange
from heli3dof.experiment.control_loop.stop_reasons import STOPPED
from heli3dof.experiment.plan import Signals
from heli3dof.experiment.safety_monitors import SafetyMonitor
from heli3dof.model.control.controller import Controller
from heli3dof.recording.row import CLOSED_LOOP, RAMP_DOWN, Row, RowSink
from heli3dof.rig.envelope import Envelope
from heli3dof.rig.interface import Rig, Sample
from heli3dof.rig.profile import Profile
from heli3dof.rig.trip import Trip

REMEMBERED_S = 12.0
"""s of motion before a trip that the search for a wiring fault uses. In built-in plans, the
references change at least every 10 s; the motion after a change shows signs and leads."""
BRIDGED = 500
"""Largest number of skipped periods for which the controller is run: many times the memory of its
filters. At 500 Hz they last 1 s, in which every watchdog expires."""
Pair = tuple[float, float]
Triple = tuple[float, float, float]


@dataclass
class Live:
    """Progress of the control loop, which a display in another thread may read at any time."""

    done: int = 0
    """Number of the plan's control periods that are over (skipped ones too), out of ``total``"""
    total: int = 1
    angle: Triple = (0.0, 0.0, 0.0)
    reference: Triple = (0.0, 0.0, 0.0)
    voltage: Pair = (0.0, 0.0)
    late: int = 0
    lost: int = 0
    lateness: float = 0.0
    """s from the deadline to the arrival of the last sample"""
    worst_lateness: float = 0.0
    """s, the largest lateness so far"""
    phase: str = "arming"


@dataclass(frozen=True)
class _End:
    ending: Ending
    detail: str
    error: BaseException | None = None


COMPLETED = _End("completed", "the plan was flown to its end")


def fly(
    rig: Rig,
    profile: Profile,
    signals: Signals,
    sink: RowSink,
    *,
    stop: Callable[[], str | None] = lambda: None,
    stop_without_ramp: Callable[[], str | None] = lambda: None,
    live: Live | None = None,
    monitors: Sequence[SafetyMonitor] = (),
) -> Outcome:
    """Fly the rendered plan in closed loop, ramp the motors to zero, and return the outcome.

    An exception of the rig, the recorder or a callback ends the flight and is part of the outcome.
    The profile must have a controller and the control rate for which ``signals`` was rendered.

    Args:
        signals: the rendered plan: references and added voltages of each control period.
        sink: receives a row for every control period.
        stop: returns why to end the flight, or None. Called in every period of the plan. If the
            plan was completed, called also in every period of the ramp to zero.
        stop_without_ramp: returns why to stop the device without the rest of the ramp to zero, or
            None. Called in every period of the ramp.
        live: receives the progress.
        monitors: safety monitors; they judge the periods in which ``stop`` is called.
    """
    flight = _Flight(rig, profile, signals, sink, stop, stop_without_ramp, live or Live(), monitors)
    with ExitStack() as undo:
        if rig.identity.timebase == "virtual":
            quiet_interpreter(undo)
            granted = None
        else:
            granted = undo.enter_context(realtime())
        end, sample = flight.fly_plan()
        end, ramp = flight.ramp_down(end, sample)
        return flight.outcome(end, ramp, granted)


class _Flight:
    """One flight. Units: t in s, angles in rad; pairs of voltages (front, back) in V.

    ``command``: the controller's voltages before the limiter, ``voltage``: after it.
    """

    def __init__(
        self,
        rig: Rig,
        profile: Profile,
        signals: Signals,
        sink: RowSink,
        stop: Callable[[], str | None],
        stop_without_ramp: Callable[[], str | None],
        live: Live,
        monitors: Sequence[SafetyMonitor],
    ) -> None:
        self.rig, self.profile, self.sink = rig, profile, sink
        self.stop, self.live, self.monitors = stop, live, tuple(monitors)
        self.reasons_against_ramp = (
            stop_without_ramp, *(monitor.stop_without_ramp for monitor in monitors),
        )  # fmt: skip
        self.rest = tuple(profile.encoder.rest_rad.tolist())
        self.rad_per_count = tuple(profile.encoder.rad_per_count.tolist())
        self.reference, self.extra, self.opened = signals.reference, signals.extra, signals.opened
        self.controller = Controller.of(profile)
        self.envelope = Envelope(profile)
        self.tally = Tally()
        self.exchange = RigExchange(rig, profile.dt, self.tally)
        self.flown = 0
        self.t0 = 0.0
        self.before: Triple = (0.0, 0.0, 0.0)
        self.moments: deque[tuple[float, Triple, Pair]] = deque(
            maxlen=round(REMEMBERED_S / profile.dt)
        )
        """(t in s, angles in rad, V at the motors) of the last periods"""

    def fly_plan(self) -> tuple[_End, Sample | None]:
        """Fly the plan; return how it ended, and the last sample.

        The sample is None if the device does not answer.
        """
        sample: Sample | None = None
        live = self.live
        live.total = len(self.reference)
        try:
            sample = self.exchange.start()
            self.t0 = sample.device_time_s
            self.controller.reset(self.angle(sample))
            live.phase = "flying"
            k = 0
            while k < len(self.reference):
                sample, end = self.period(k, sample)
                if end is not None:
                    return end, sample
                k += 1 + self.exchange.time.skipped
                live.done = k
            # No period of the plan judges a gap of samples that reaches beyond the plan's end.
            if (report := self.judge_ramp(sample, self.exchange.sent)) is not None:
                return _End("tripped", report), sample
        except DeviceError as problem:
            return _End("device", problem.what, problem), None
        except BaseException as problem:
            return _End("error", f"{type(problem).__name__}: {problem}", problem), sample
        return COMPLETED, sample

    def ramp_down(self, end: _End, sample: Sample | None) -> tuple[_End, RampDown]:
        """Ramp to zero from the last ``sample``; return how flight and ramp ended.

        ``end``: how the plan ended. ``sample``: None if the device does not answer.
        """
        self.live.phase = "ramping down"
        limits = self.profile.limits
        steps, supervision = self.steps(limits.ramp_down_s), None
        recorder = GuardedRecorder(self.sink.append)
        completed = end.ending == "completed"
        if completed:
            supervision = Supervision(
                monitor=self.judge_ramp,
                reason_to_shorten=lambda: self.stop() or recorder.problem,
                awaits_fall=lambda: any(monitor.awaits_fall() for monitor in self.monitors),
                shortened_steps=steps,
            )
            steps = self.steps(limits.landing_s)
        known = int(sample.flags) if sample is not None and end.ending == "tripped" else 0
        ramp = ramp_to_zero(
            self.exchange, sample, steps, self.profile.motor, self.ramp_recorder(recorder),
            self.stop_without_ramp, known=known, supervision=supervision,
        )  # fmt: skip
        if completed and recorder.failure is not None and not ramp.stopped and not ramp.tripped:
            return _End("error", recorder.problem or "", recorder.failure), ramp
        return _after_ramp(end, ramp), ramp

    def outcome(self, end: _End, ramp: RampDown, granted: Realtime | None) -> Outcome:
        """Return the flight's outcome; it names a wiring fault if one explains a safety trip.

        ``end``, ``ramp``: how the plan and the ramp ended. ``granted``: which real-time settings
        the system granted; None on a virtual clock.
        """
        detail, tally = end.detail, self.tally
        if end.ending == "tripped" and isinstance(detail, Trip) and detail.may_be_wiring_fault:
            from heli3dof.experiment.safety_monitors.wiring_fault import Moment, with_cause

            with suppress(Exception):  # a failed search must not lose the trip
                detail = with_cause(detail, [Moment(*m) for m in self.moments], self.profile)
        virtual = self.rig.identity.timebase == "virtual"
        return Outcome(
            end.ending, detail, self.flown, tally.late, tally.missed, tally.worst, ramp.finished,
            end.error, tally.lost, None if virtual else tally.punctuality(), granted,
            link_counts(self.rig), tally.device_skipped, self.exchange.echo.measured(),
            self.exchange.device_cause, ramp.ramped,
        )  # fmt: skip

    def angle(self, sample: Sample) -> Triple:
        """Return the angles (roll, pitch, yaw) in rad for the encoder counts in ``sample``."""
        c, q, z = sample.counts, self.rad_per_count, self.rest
        return (z[0] + c[0] * q[0], z[1] + c[1] * q[1], z[2] + c[2] * q[2])

    def period(self, k: int, sample: Sample) -> tuple[Sample, _End | None]:
        """Fly period ``k`` of the plan; ``sample`` was taken at the period's beginning.

        Returns the next sample and None. If the flight ends in this period, returns ``sample``
        and how it ended.
        """
        exchange, time, live = self.exchange, self.exchange.time, self.live
        if exchange.unreadable is not None:
            return sample, _End("tripped", exchange.unreadable)
        angle = self.angle(sample)
        if time.skipped:
            self.bridge(k, time.skipped, angle)
        self.before = angle
        reference, extra, command, voltage = self.control(k, angle)
        t = sample.device_time_s - self.t0
        self.moments.append((t, angle, motor_voltage(sample, exchange.sent)))
        end = self.reason_to_end(k, t, sample, angle, command, voltage)
        if end is not None:
            return sample, end
        lateness = time.lateness
        after = exchange.exchange(sample, voltage)
        self.sink.append(
            Row(
                t, sample, angle, reference, self.controller.limited_reference, extra, command,
                voltage, exchange.sequence, after.v_applied, lateness, CLOSED_LOOP,
            )
        )  # fmt: skip
        self.flown += 1
        live.angle, live.reference, live.voltage = angle, reference, voltage
        live.late, live.lost = self.tally.late, self.tally.lost
        live.lateness, live.worst_lateness = time.lateness, self.tally.worst
        return after, None

    def control(self, k: int, angle: Triple) -> tuple[Triple, Pair, Pair, Pair]:
        """Run the controller for period ``k``; return the reference and three pairs of voltages.

        The pairs (front, back) in V are the voltages that the plan adds, the controller's output
        before the voltage limiter, and the output after it.
        """
        # Plain floats, converted row by row: those of an hour would fill the memory.
        reference, extra = tuple(self.reference[k].tolist()), tuple(self.extra[k].tolist())
        if self.opened is None:
            return (reference, extra, *self.controller.step(angle, reference, extra))
        return self.controller.step_opened(self.opened[k].tolist(), angle, reference, extra)

    def bridge(self, k: int, skipped: int, angle: Triple) -> None:
        """Run the controller for the ``skipped`` periods before ``k``, with interpolated angles.

        Without this step the controller's filters would attribute the motion of all these periods
        to one period. Of more than `BRIDGED` skipped periods, only the last `BRIDGED` are run.
        """
        before = self.before
        for j in range(max(1, skipped - BRIDGED + 1), skipped + 1):
            share = j / (skipped + 1)
            r, p, y = (a + share * (b - a) for a, b in zip(before, angle, strict=True))
            self.control(k - skipped + j - 1, (r, p, y))

    def reason_to_end(
        self, k: int, t: float, sample: Sample, angle: Triple, command: Pair, voltage: Pair
    ) -> _End | None:
        """Return why the flight ends in period ``k``, or None.

        Checks, in this order, a request to stop, the device's flags and the safety monitors
        together, and the envelope (the profile's limits).
        """
        if (requested := self.stop()) is not None:
            return _End("interrupted", requested)
        rates = self.controller.rates
        report = self.judge(k, t, sample, angle, command, voltage)
        # A monitor's report is closer to the cause than the envelope's.
        flags = int(sample.flags)
        stopped = self.exchange.explain(flags) if flags & STOPPED else None
        if (seen := Trip.first(stopped, report)) is not None:
            return _End("tripped", seen)
        tripped = self.envelope.check(t, angle, rates, command, voltage)
        return _End("tripped", tripped) if tripped is not None else None

    def judge(
        self, k: int, t: float, sample: Sample, angle: Triple, command: Pair, voltage: Pair,
        ramping_down: bool = False,
    ) -> str | None:  # fmt: skip
        """Let the safety monitors judge the control period with index ``k`` in the plan.

        Returns the first report, which states why the flight must end, or None. `Period` describes
        the other arguments.
        """
        if not self.monitors:
            return None
        exchange, time = self.exchange, self.exchange.time
        now = Period(
            k, t, sample, angle, self.controller.rates, command, voltage, exchange.sent,
            exchange.sequence, time.lateness, time.skipped, time.device_skipped,
            exchange.echo.last_s, ramping_down,
        )  # fmt: skip
        for monitor in self.monitors:
            if (report := monitor(now)) is not None:
                return report
        return None

    def judge_ramp(self, sample: Sample, voltage: Pair) -> str | None:
        """Let the safety monitors judge one period of the ramp to zero at the end of the flight.

        Returns a report, which states why to end the ramp early, or None. ``voltage``:
        voltages (front, back) in V that were sent before ``sample`` was taken.
        """
        t = sample.device_time_s - self.t0
        k = len(self.reference)
        return self.judge(k, t, sample, self.angle(sample), voltage, voltage, True)

    def stop_without_ramp(self) -> str | None:
        """Return why to stop the device at once: a request, or a monitor's report; or None."""
        return next(filter(None, (reason() for reason in self.reasons_against_ramp)), None)

    def steps(self, seconds: float) -> int:
        return max(1, round(seconds / self.profile.dt))

    def ramp_recorder(
        self, append: Callable[[Row], None]
    ) -> Callable[[Sample, Pair, float, Sample], None]:
        """Return a function that records one period of the ramp to zero by calling ``append``."""
        held = self.controller.limited_reference

        def record(sample: Sample, voltage: Pair, lateness: float, after: Sample) -> None:
            append(
                Row(
                    sample.device_time_s - self.t0, sample, self.angle(sample), held, held,
                    (0.0, 0.0), voltage, voltage, self.exchange.sequence, after.v_applied, lateness,
                    RAMP_DOWN,
                )
            )  # fmt: skip

        return record


def _after_ramp(end: _End, ramp: RampDown) -> _End:
    before = "the landing was cut short" if end is COMPLETED else end.detail
    detail = Trip.first(before, ramp.reason) or ""
    if ramp.stopped:
        return replace(end, ending="tripped", detail=detail)
    if ramp.tripped is not None:
        return replace(end, ending="tripped", detail=ramp.tripped)
    if ramp.requested is not None:
        return replace(end, ending="interrupted", detail=ramp.requested)
    if ramp.error is not None and end.ending == "completed":
        ending: Ending = "device" if isinstance(ramp.error, DeviceError) else "error"
        return _End(ending, ramp.reason, ramp.error)
    return replace(end, detail=detail) if ramp.reason else end
