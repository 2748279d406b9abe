"""The flight loop: sample, controller, envelope, command; once per control period.

    sample k → angles k → V[k] = controller(angles k, references k) → held until sample k+1

Deadlines are absolute and periods that were missed altogether are skipped, never flown in a burst
(see `heli3dof.experiment.control_loop.timekeeping`). Whatever ends the flight, the motors go to
zero: in a ramp from hover, at once from elsewhere, recorded either way (see
`heli3dof.experiment.control_loop.ramp_down`).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

from heli3dof.errors import DeviceError
from heli3dof.experiment.control_loop.control_period import Period, Watch, motor_voltage
from heli3dof.experiment.control_loop.outcome import Ending, Outcome, Tally, link_counts
from heli3dof.experiment.control_loop.ramp_down import Kept, land
from heli3dof.experiment.control_loop.realtime_priority import Realtime, quiet_interpreter, realtime
from heli3dof.experiment.control_loop.rig_exchange import Pacer
from heli3dof.experiment.control_loop.stop_reasons import STOPPED, explain
from heli3dof.experiment.plan import Signals
from heli3dof.model.control.loop_opening import OpenedController
from heli3dof.recording.row import CLOSED_LOOP, RAMP_DOWN, Row, RowSink
from heli3dof.rig.envelope import Envelope
from heli3dof.rig.interface import Identity, Rig, Sample
from heli3dof.rig.profile import Profile
from heli3dof.rig.trip import Trip

REMEMBERED_S = 4.0
"""s of motion in which the cause of a trip is looked for"""
BRIDGED = 500
"""Skipped periods through which the controller is taken, at most: the last ones, many times what
its filters remember. Who slept for an hour must not first fly it through in his head; and no flight
goes on after so many, since every device's watchdog has expired by then."""
Pair = tuple[float, float]
Triple = tuple[float, float, float]


@dataclass
class Live:
    """What a progress display may look at while the loop runs; the loop never waits for it."""

    done: int = 0
    total: int = 1
    angle: tuple[float, float, float] = (0.0, 0.0, 0.0)
    voltage: tuple[float, float] = (0.0, 0.0)
    late: int = 0
    lateness: float = 0.0
    """s, of the last sample"""
    phase: str = "arming"


def fly(
    rig: Rig,
    profile: Profile,
    signals: Signals,
    sink: RowSink,
    *,
    stop: Callable[[], str | None] = lambda: None,
    at_once: Callable[[], str | None] = lambda: None,
    live: Live | None = None,
    watches: Sequence[Watch] = (),
    must_still_fall: Callable[[], bool] = lambda: False,
) -> Outcome:
    """Fly the rendered plan in closed loop and return how it ended. Never raises.

    ``stop`` is asked in every period and returns why to end, or None; in the landing at the plan's
    end, too. ``at_once`` is asked in every period of the ramp to zero, and returns why to stop
    without the rest of it.
    ``watches`` judge every period in their order, before the envelope, and the ramp to zero too:
    a flight whose angles contradict its voltages is not completed. While ``must_still_fall`` is
    true the ramp goes on at zero volts. The profile must have a controller and its rate must be
    the signals'.
    """
    flight = _Flight(rig, profile, signals, sink, stop, live or Live(), watches)
    with _granted(rig.identity) as granted:
        return flight.run(at_once, granted, must_still_fall)


class _Flight:
    def __init__(
        self,
        rig: Rig,
        profile: Profile,
        signals: Signals,
        sink: RowSink,
        stop: Callable[[], str | None],
        live: Live,
        watches: Sequence[Watch],
    ) -> None:
        self.rig, self.profile, self.sink = rig, profile, sink
        self.stop, self.live, self.watches = stop, live, tuple(watches)
        self.rest = tuple(profile.encoder.rest_rad.tolist())
        self.rad_per_count = tuple(profile.encoder.rad_per_count.tolist())
        self.reference, self.extra, self.opened = signals.reference, signals.extra, signals.opened
        self.controller = OpenedController.of(profile)
        self.envelope = Envelope(profile)
        self.tally = Tally()
        self.pacer = Pacer(rig, profile.dt, self.tally)
        self.virtual = rig.identity.timebase == "virtual"
        self.flown = 0
        self.t0 = 0.0
        self.before: Triple = (0.0, 0.0, 0.0)
        self.moments: deque[tuple[float, Triple, Pair]] = deque(
            maxlen=round(REMEMBERED_S / profile.dt)
        )
        """(t in s, angles in rad, V at the motors) of the last periods, for a trip's cause"""

    def run(
        self,
        at_once: Callable[[], str | None],
        granted: Realtime | None,
        must_still_fall: Callable[[], bool],
    ) -> Outcome:
        ending: Ending = "completed"
        detail = "the plan was flown to its end"
        error: BaseException | None = None
        sample: Sample | None = None
        live = self.live
        live.total = len(self.reference)
        try:
            sample = self.pacer.start()
            self.t0 = sample.device_time_s
            self.controller.reset(self.angle(sample))
            live.phase = "flying"
            k = 0
            while k < len(self.reference):
                sample, why = self.period(k, sample)
                if why is not None:
                    ending, detail = why
                    break
                k += 1 + self.pacer.skipped
                live.done = k
        except DeviceError as problem:
            ending, detail, error, sample = "device", problem.what, problem, None
        except BaseException as problem:
            ending, detail, error = "error", f"{type(problem).__name__}: {problem}", problem
        live.phase = "ramping down"
        hurried = self.steps(hurried=True)
        known = int(sample.flags) if sample is not None and ending == "tripped" else 0
        whole = ending == "completed"
        kept = Kept(self.sink.append)
        landing = land(
            self.pacer, sample, self.steps(hurried=False) if whole else hurried,
            self.profile.motor, self.keeper(kept), at_once, known,
            self.monitored if whole else lambda sample, voltage: None,
            must_still_fall if whole else lambda: False,
            (lambda: self.stop() or kept.problem) if whole else lambda: None,
            hurried,
        )  # fmt: skip
        if landing.stopped:
            ending, detail = "tripped", Trip.first(detail, landing.why) or ""
        elif landing.tripped is not None:
            ending, detail = "tripped", landing.tripped
        elif whole and kept.failure is not None:
            ending, detail, error = "error", kept.problem or "", kept.failure
        elif landing.asked is not None:
            ending, detail = "interrupted", landing.asked
        elif landing.error is not None and ending == "completed":
            ending = "device" if isinstance(landing.error, DeviceError) else "error"
            detail, error = landing.why, landing.error
        elif landing.why:
            detail = Trip.first(detail, landing.why) or ""
        if ending == "tripped" and isinstance(detail, Trip) and detail.by_motion:
            from heli3dof.experiment.safety_monitors.wiring_fault import Moment, with_cause

            detail = with_cause(detail, [Moment(*m) for m in self.moments], self.profile)
        tally = self.tally
        return Outcome(
            ending, detail, self.flown, tally.late, tally.missed, tally.worst, landing.landed,
            error, tally.lost, None if self.virtual else tally.punctuality(), granted,
            link_counts(self.rig), tally.left_out, self.pacer.echo.measured(),
            self.pacer.device_cause, landing.ramped,
        )  # fmt: skip

    def angle(self, sample: Sample) -> tuple[float, float, float]:
        c, q, z = sample.counts, self.rad_per_count, self.rest
        return (z[0] + c[0] * q[0], z[1] + c[1] * q[1], z[2] + c[2] * q[2])

    def period(self, k: int, sample: Sample) -> tuple[Sample, tuple[Ending, str] | None]:
        """One control period. Returns the next sample, or the same one and why to end."""
        if self.pacer.unreadable is not None:
            return sample, ("tripped", self.pacer.unreadable)
        angle = self.angle(sample)
        if self.pacer.skipped:
            self.bridge(k, self.pacer.skipped, angle)
        self.before = angle
        reference, extra, command, voltage = self.control(k, angle)
        t = sample.device_time_s - self.t0
        self.moments.append((t, angle, motor_voltage(sample, self.pacer.sent)))
        why = self.reason_to_end(k, t, sample, angle, command, voltage)
        if why is not None:
            return sample, why
        pacer, live = self.pacer, self.live
        lateness = pacer.lateness
        after = pacer.exchange(sample, voltage)
        self.sink.append(
            Row(
                t, sample, angle, reference, self.controller.limited_reference, extra, command,
                voltage, pacer.sequence, after.v_applied, lateness, CLOSED_LOOP,
            )
        )  # fmt: skip
        self.flown += 1
        live.angle, live.voltage, live.late = angle, voltage, self.tally.late
        live.lateness = pacer.lateness
        return after, None

    def control(self, k: int, angle: Triple) -> tuple[Triple, Pair, Pair, Pair]:
        """(reference, extra, command, voltage) of period k."""
        # Plain floats from here on, made row by row: an hour of them would fill the memory.
        reference, extra = tuple(self.reference[k].tolist()), tuple(self.extra[k].tolist())
        if self.opened is None:
            return (reference, extra, *self.controller.step(angle, reference, extra))
        return self.controller.step_opened(self.opened[k].tolist(), angle, reference, extra)

    def bridge(self, k: int, skipped: int, angle: Triple) -> None:
        """The controller goes through the periods that were skipped before k, along a straight line
        from the last angle: to its filters a longer way in one period would be a greater rate."""
        was = self.before
        for j in range(max(1, skipped - BRIDGED + 1), skipped + 1):
            share = j / (skipped + 1)
            r, p, y = (a + share * (b - a) for a, b in zip(was, angle, strict=True))
            self.control(k - skipped + j - 1, (r, p, y))

    def reason_to_end(
        self,
        k: int,
        t: float,
        sample: Sample,
        angle: tuple[float, float, float],
        command: tuple[float, float],
        voltage: tuple[float, float],
    ) -> tuple[Ending, str] | None:
        asked = self.stop()
        if asked is not None:
            return "interrupted", asked
        rates = self.controller.rates
        looked = self.judged(k, t, sample, angle, command, voltage)
        # What a watch saw is nearer to the cause than what came of it.
        stopped = None
        if (flags := int(sample.flags)) & STOPPED:
            stopped = explain(flags, self.pacer.device_cause)
        if (seen := Trip.first(stopped, looked)) is not None:
            return "tripped", seen
        tripped = self.envelope.check(t, angle, rates, command, voltage)
        return ("tripped", tripped) if tripped is not None else None

    def judged(
        self, k: int, t: float, sample: Sample, angle: Triple, command: Pair, voltage: Pair,
        ramping_down: bool = False,
    ) -> str | None:  # fmt: skip
        """What the first of the safety monitors reports of this period, or None."""
        if not self.watches:
            return None
        pacer = self.pacer
        now = Period(
            k, t, sample, angle, self.controller.rates, command, voltage, pacer.sent,
            pacer.sequence, pacer.lateness, pacer.skipped, pacer.left_out, pacer.echo.last_s,
            ramping_down,
        )  # fmt: skip
        return next(filter(None, (watch(now) for watch in self.watches)), None)

    def monitored(self, sample: Sample, voltage: Pair) -> str | None:
        """A period of the ramp to zero, as the safety monitors judge it."""
        t = sample.device_time_s - self.t0
        return self.judged(self.flown, t, sample, self.angle(sample), voltage, voltage, True)

    def steps(self, *, hurried: bool) -> int:
        """Periods of the ramp to zero."""
        limits = self.profile.limits
        ramp_s = limits.ramp_down_s if hurried else limits.landing_s
        return max(1, round(ramp_s / self.profile.dt))

    def keeper(self, keep: Kept) -> Callable[[Sample, tuple[float, float], float, Sample], None]:
        """Records the periods of the ramp, for as long as the recorder takes them."""
        held = self.controller.limited_reference

        def row(
            sample: Sample, voltage: tuple[float, float], lateness: float, after: Sample
        ) -> None:
            keep(
                Row(
                    sample.device_time_s - self.t0, sample, self.angle(sample), held, held,
                    (0.0, 0.0), voltage, voltage, self.pacer.sequence, after.v_applied, lateness,
                    RAMP_DOWN,
                )
            )  # fmt: skip

        return row


@contextmanager
def _granted(identity: Identity) -> Iterator[Realtime | None]:
    """What the system grants the loop; on a virtual clock nothing is asked for."""
    with ExitStack() as undo:
        if identity.timebase == "virtual":
            quiet_interpreter(undo)
            yield None
        else:
            yield undo.enter_context(realtime())
