"""The flight loop: sample, controller, envelope, command; once per control period.

    sample k → angles k → V[k] = controller(angles k, references k) → held until sample k+1

Deadlines are absolute (due[k+1] = due[k] + dt): a late period does not shift those after it,
and periods that were missed altogether are skipped, never flown in a burst. Whatever ends the
flight, the motors are ramped to zero and every period of the ramp is recorded too.
"""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Literal

from heli3dof.errors import DeviceError
from heli3dof.experiment.period import Period, Watch
from heli3dof.experiment.plan import Signals
from heli3dof.model.opened import OpenedController
from heli3dof.recording.row import CLOSED_LOOP, RAMP_DOWN, Row, RowSink
from heli3dof.rig.envelope import Envelope
from heli3dof.rig.port import Command, Flags, Rig, Sample
from heli3dof.rig.profile import Profile

LATE_S = 1e-3
"""A period whose sample came later than this after its deadline counts as late."""

Ending = Literal["completed", "tripped", "interrupted", "device", "error"]


@dataclass
class Live:
    """What a progress display may look at while the loop runs; the loop never waits for it."""

    done: int = 0
    total: int = 1
    angle: tuple[float, float, float] = (0.0, 0.0, 0.0)
    voltage: tuple[float, float] = (0.0, 0.0)
    late: int = 0
    phase: str = "arming"


@dataclass(frozen=True)
class Outcome:
    """How a flight ended; written into the recording last."""

    ending: Ending
    detail: str
    periods: int
    """Control periods flown in closed loop."""
    late: int
    """Periods later than `LATE_S`."""
    missed: int
    """Periods skipped because they were missed altogether."""
    worst_lateness_s: float
    landed: bool
    """True when the ramp to zero volts was carried out."""
    error: BaseException | None = field(default=None, compare=False)


@dataclass
class _Tally:
    periods: int = 0
    late: int = 0
    missed: int = 0
    worst: float = 0.0


def fly(
    rig: Rig,
    profile: Profile,
    signals: Signals,
    sink: RowSink,
    *,
    stop: Callable[[], str | None] = lambda: None,
    live: Live | None = None,
    watches: Sequence[Watch] = (),
) -> Outcome:
    """Fly the rendered plan in closed loop and return how it ended. Never raises.

    ``stop`` is asked in every period and returns why to end, or None; ``watches`` are asked in
    their order, after the envelope. The profile must have a controller and its rate must be the
    signals'.
    """
    flight = _Flight(rig, profile, signals, sink, stop, live or Live(), watches)
    with _quiet_interpreter():
        return flight.run()


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
        self.dt = profile.dt
        self.rest = tuple(profile.encoder.rest_rad.tolist())
        self.rad_per_count = tuple(profile.encoder.rad_per_count.tolist())
        # Plain floats: indexing a list costs a tenth of indexing an array.
        self.reference = [tuple(row) for row in signals.reference.tolist()]
        self.extra = [tuple(row) for row in signals.extra.tolist()]
        self.opened = None if signals.opened is None else signals.opened.tolist()
        self.controller = OpenedController.of(profile)
        self.envelope = Envelope(profile)
        self.tally = _Tally()
        self.sequence = 0
        self.due = 0.0
        self.t0 = 0.0
        self.lateness = 0.0
        self.missed = 0
        self.sent = (0.0, 0.0)
        self.device_timed = rig.identity.timebase != "host"

    def run(self) -> Outcome:
        ending: Ending = "completed"
        detail = "the plan was flown to its end"
        error: BaseException | None = None
        sample: Sample | None = None
        live = self.live
        live.total = len(self.reference)
        try:
            sample = self.rig.arm()
            self.t0 = sample.device_time_s
            self.due = sample.host_time_s
            self.controller.reset(self.angle(sample))
            live.phase = "flying"
            k = 0
            while k < len(self.reference):
                sample, why = self.period(k, sample)
                if why is not None:
                    ending, detail = why
                    break
                k += 1 + self.skip()
                live.done = k
        except DeviceError as problem:
            ending, detail, error, sample = "device", problem.what, problem, None
        except BaseException as problem:
            ending, detail, error = "error", f"{type(problem).__name__}: {problem}", problem
        landed = self.land(sample, hurried=ending != "completed")
        tally = self.tally
        return Outcome(
            ending, detail, tally.periods, tally.late, tally.missed, tally.worst, landed, error
        )

    def angle(self, sample: Sample) -> tuple[float, float, float]:
        c, q, z = sample.counts, self.rad_per_count, self.rest
        return (z[0] + c[0] * q[0], z[1] + c[1] * q[1], z[2] + c[2] * q[2])

    def period(self, k: int, sample: Sample) -> tuple[Sample, tuple[Ending, str] | None]:
        """One control period. Returns the next sample, or the same one and why to end."""
        angle = self.angle(sample)
        reference, extra = self.reference[k], self.extra[k]
        if self.opened is None:
            command, voltage = self.controller.step(angle, reference, extra)
        else:
            reference, extra, command, voltage = self.controller.step_opened(
                self.opened[k], angle, reference, extra
            )
        t = sample.device_time_s - self.t0
        why = self.reason_to_end(k, t, sample, angle, command, voltage)
        if why is not None:
            return sample, why
        after = self.exchange(voltage)
        self.sink.append(
            Row(
                t,
                sample,
                angle,
                reference,
                self.controller.limited_reference,
                extra,
                command,
                voltage,
                self.sequence,
                after.v_applied,
                self.lateness,
                CLOSED_LOOP,
            )
        )
        self.clock(after)
        self.tally.periods += 1
        self.live.angle, self.live.voltage = angle, voltage
        return after, None

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
        if sample.flags & (Flags.ESTOP | Flags.LATCHED | Flags.FAULT | Flags.STALL):
            return "tripped", _explain(sample.flags)
        rates = self.controller.rates
        tripped = self.envelope.check(t, angle, rates, command, voltage)
        if tripped is None and self.watches:
            now = Period(
                k, t, sample, angle, rates, command, voltage, self.sent, self.sequence,
                self.lateness, self.missed,
            )  # fmt: skip
            tripped = next(filter(None, (watch(now) for watch in self.watches)), None)
        return ("tripped", tripped) if tripped is not None else None

    def exchange(self, voltage: tuple[float, float]) -> Sample:
        self.sequence = (self.sequence + 1) & 0xFFFFFFFF
        self.due += self.dt
        self.sent = voltage
        return self.rig.exchange(Command(self.sequence, voltage[0], voltage[1]), self.due)

    def clock(self, sample: Sample) -> None:
        """Measure how late a sample was; where the device keeps time there is no lateness."""
        self.lateness = 0.0 if self.device_timed else sample.host_time_s - self.due
        if self.lateness > LATE_S:
            self.tally.late += 1
            self.live.late = self.tally.late
        self.tally.worst = max(self.tally.worst, self.lateness)

    def skip(self) -> int:
        """Periods that passed unused because this one was late; the deadline moves past them."""
        self.missed = missed = int(self.lateness / self.dt) if self.lateness > self.dt else 0
        self.due += missed * self.dt
        self.tally.missed += missed
        return missed

    def land(self, sample: Sample | None, *, hurried: bool) -> bool:
        """Ramp the motors to zero and record it; stop the device at once where that fails."""
        limits = self.profile.limits
        self.live.phase = "ramping down"
        if sample is None:
            return self._estop("the device did not answer")
        start = self.sent
        steps = max(1, round((limits.ramp_down_s if hurried else limits.landing_s) / self.dt))
        keep: Callable[[Row], None] | None = self.sink.append
        try:
            for i in range(1, steps + 1):
                share = 1 - i / steps
                voltage = (start[0] * share, start[1] * share)
                before, sample = sample, self.exchange(voltage)
                keep = _kept(keep, self.landing_row(before, voltage, sample))
                self.clock(sample)
                self.skip()
        except BaseException as problem:
            return self._estop(f"the ramp to zero failed: {problem}")
        return True

    def landing_row(self, sample: Sample, voltage: tuple[float, float], after: Sample) -> Row:
        held = self.controller.limited_reference
        return Row(
            sample.device_time_s - self.t0, sample, self.angle(sample), held, held, (0.0, 0.0),
            voltage, voltage, self.sequence, after.v_applied, self.lateness, RAMP_DOWN,
        )  # fmt: skip

    def _estop(self, why: str) -> bool:
        try:
            self.rig.estop(why)
        except Exception:
            # The device's own watchdog is what remains; the outcome says that nothing landed.
            return False
        return False


def _kept(keep: Callable[[Row], None] | None, row: Row) -> Callable[[Row], None] | None:
    """Keep a row of the ramp; a recorder that fails must not keep the motors from zero."""
    if keep is None:
        return None
    try:
        keep(row)
    except Exception:
        return None
    return keep


def _explain(flags: Flags) -> str:
    said = {
        Flags.ESTOP: "an emergency stop is in force",
        Flags.LATCHED: "the device's watchdog expired: no command reached it in time",
        Flags.FAULT: "the amplifier reports a fault",
        Flags.STALL: "a motor is stalled",
    }
    return "; ".join(text for flag, text in said.items() if flags & flag)


@contextmanager
def _quiet_interpreter() -> Iterator[None]:
    """No garbage collection in the loop, and threads that give way quickly."""
    interval, collecting = sys.getswitchinterval(), gc.isenabled()
    gc.collect()
    gc.disable()
    sys.setswitchinterval(2e-4)
    try:
        yield
    finally:
        sys.setswitchinterval(interval)
        if collecting:
            gc.enable()
