"""However a flight ends, the motors end at zero and the recording holds the reason."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
import pytest
from heli3dof_drivers.link.request_reply import LinkStatistics

from heli3dof.errors import DeviceError
from heli3dof.experiment.control_loop.control_period import Period
from heli3dof.experiment.control_loop.loop import fly
from heli3dof.experiment.control_loop.outcome import Outcome
from heli3dof.experiment.plan import step_plan
from heli3dof.model.control.controller import Controller
from heli3dof.recording.memory import MemoryRecorder
from heli3dof.recording.row import CLOSED_LOOP, RAMP_DOWN
from heli3dof.rig.interface import Command, Flags, Identity, Sample
from heli3dof.rig.profile import Profile, default_profile
from heli3dof.rig.trip import Trip
from tests.experiment.safety_monitors.periods import Judging

PROFILE = default_profile()
DT = PROFILE.dt
ROLL_UP_ONE_DEGREE = 4096 / 360


class ScriptedRig:
    """A rig at rest at level, until a script changes a sample or raises."""

    def __init__(
        self,
        script: Callable[[int, Sample], Sample] = lambda k, s: s,
        *,
        late: Callable[[int], float] = lambda k: 0.0,
        timebase: str = "device",
    ) -> None:
        self.script, self.late = script, late
        self.identity = Identity(
            "test", "scripted", "0", "0", "0", (4096, 4096, 8192), 24.0, 0.1, timebase, True
        )
        self.commands: list[Command] = []
        self.stopped: list[str] = []
        self.now = 0.0

    def sample(self, sequence: int, applied: tuple[float, float]) -> Sample:
        level = round(27.5 * ROLL_UP_ONE_DEGREE)
        return Sample(
            sequence, self.now, (level, 0, 0), applied, (np.nan, np.nan), Flags.ENABLED, self.now
        )

    def arm(self) -> Sample:
        return self.script(0, self.sample(0, (0.0, 0.0)))

    def exchange(self, command: Command, due_s: float) -> Sample:
        self.commands.append(command)
        k = len(self.commands)
        device_timed = self.identity.timebase == "device"
        self.now = (self.now + DT if device_timed else due_s) + self.late(k)
        return self.script(k, self.sample(command.sequence, (command.v_front, command.v_back)))

    def estop(self, reason: str) -> None:
        self.stopped.append(reason)

    def close(self) -> None:
        pass


def flown(
    rig: ScriptedRig, *, profile: Profile = PROFILE, periods: int = 100,
    monitors: Iterable[Callable[[Period], object]] = (), **keys: object,
) -> tuple[Outcome, MemoryRecorder]:  # fmt: skip
    plan = step_plan((0.0, None, None), settle_s=0, duration_s=periods * profile.dt)
    sink = MemoryRecorder()
    signals, judges = plan.render(profile.dt, 0), [Judging(m) for m in monitors]
    outcome = fly(rig, profile, signals, sink, monitors=judges, **keys)
    return outcome, sink


def ends_at_zero(rig: ScriptedRig) -> bool:
    last = rig.commands[-1]
    return (last.v_front, last.v_back) == (0.0, 0.0)


def test_a_completed_plan_ends_with_the_slow_ramp() -> None:
    rig = ScriptedRig()
    outcome, sink = flown(rig)
    assert (outcome.ending, outcome.periods, outcome.landed) == ("completed", 100, True)
    assert ends_at_zero(rig)
    ramp = [r for r in sink.rows if r.phase == RAMP_DOWN]
    assert len(ramp) == round(PROFILE.limits.landing_s / DT)
    volts = [r.voltage[0] for r in ramp]
    assert volts == sorted(volts, reverse=True)
    assert not rig.stopped


def test_a_row_holds_the_sample_and_the_voltage_computed_from_it() -> None:
    rig = ScriptedRig()
    _, sink = flown(rig)
    row = sink.rows[5]
    assert row.sample.sequence == 5  # the sample that the fifth command brought
    assert row.command_sequence == 6
    assert row.voltage == (rig.commands[5].v_front, rig.commands[5].v_back)
    assert row.applied == row.voltage
    assert row.t == pytest.approx(5 * DT)


def test_the_voltage_is_the_documented_control_law() -> None:
    rig = ScriptedRig()
    _, sink = flown(rig)
    controller = Controller.of(PROFILE)
    controller.reset(sink.rows[0].angle)
    for row in sink.rows[:100]:
        assert controller.step(row.angle, row.reference, row.extra) == (row.command, row.voltage)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda k, s: replace(s, counts=(s.counts[0] + 400, 0, 0)), "roll reached 35.17°"),
        (lambda k, s: replace(s, counts=(s.counts[0], 0, 12 * (k - 39))), "yaw turned at"),
        (lambda k, s: replace(s, counts=(s.counts[0], 200, 0)), "voltage jumped"),
        (lambda k, s: replace(s, flags=s.flags | Flags.ESTOP), "emergency stop"),
        (lambda k, s: replace(s, flags=s.flags | Flags.LATCHED), "watchdog"),
        (lambda k, s: replace(s, flags=s.flags | Flags.FAULT), "fault"),
        (lambda k, s: replace(s, flags=s.flags | Flags.STALL), "stalled"),
    ],
)
def test_a_trip_ends_the_flight_with_a_ramp_to_zero(change: Callable, message: str) -> None:
    rig = ScriptedRig(lambda k, s: change(k, s) if k >= 40 else s)
    outcome, sink = flown(rig)
    assert outcome.ending == "tripped"
    assert message in outcome.detail
    assert 40 <= outcome.periods < 60
    assert ends_at_zero(rig)
    ramp = [r for r in sink.rows if r.phase == RAMP_DOWN]
    assert len(ramp) == round(PROFILE.limits.ramp_down_s / DT)


def test_a_monitor_judges_every_period_and_its_report_ends_the_flight() -> None:
    rig = ScriptedRig()
    seen = []

    def monitor(now: Period) -> str | None:
        seen.append(now)
        return "seen enough" if now.k == 40 else None

    outcome, sink = flown(rig, monitors=[monitor, lambda now: None])
    assert (outcome.ending, outcome.detail) == ("tripped", "seen enough")
    assert [now.k for now in seen] == list(range(41))
    assert ends_at_zero(rig)
    last = seen[-1]
    assert last.sample.sequence == last.command_sequence == 40
    assert last.sent == sink.rows[39].voltage
    assert (last.t, last.skipped) == (pytest.approx(40 * DT), 0)


def test_a_monitor_that_raises_ends_the_flight_with_a_ramp_to_zero() -> None:
    rig = ScriptedRig()
    outcome, _ = flown(rig, monitors=[lambda now: "" * (1 // (now.k - 10)) or None])
    assert (outcome.ending, outcome.periods, outcome.landed) == ("error", 10, True)
    assert ends_at_zero(rig)


def test_a_failed_search_for_the_cause_of_a_trip_does_not_lose_the_outcome(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fails(*_: object) -> None:
        raise np.linalg.LinAlgError("SVD did not converge")

    monkeypatch.setattr("heli3dof.experiment.safety_monitors.wiring_fault.with_cause", fails)
    report = Trip("did not turn", "not known.", "look", may_be_wiring_fault=True)
    outcome, _ = flown(ScriptedRig(), monitors=[lambda now: report if now.k == 40 else None])
    assert (outcome.ending, outcome.detail) == ("tripped", "did not turn")


def test_a_request_to_stop_ends_the_flight_with_a_ramp_to_zero() -> None:
    rig = ScriptedRig()
    reasons = iter([None] * 10 + ["stopped with Ctrl-C"] * 1000)
    outcome, _ = flown(rig, stop=lambda: next(reasons))
    assert (outcome.ending, outcome.detail) == ("interrupted", "stopped with Ctrl-C")
    assert ends_at_zero(rig)


def test_an_exception_in_the_controller_ends_the_flight_with_a_ramp_to_zero(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    calls = iter(range(1000))
    step = Controller.step

    def broken(self: Controller, *a: object) -> object:
        if next(calls) == 20:
            raise ZeroDivisionError("division by zero")
        return step(self, *a)

    monkeypatch.setattr(Controller, "step", broken)
    rig = ScriptedRig()
    outcome, _ = flown(rig)
    assert outcome.ending == "error"
    assert "ZeroDivisionError" in outcome.detail
    assert outcome.periods == 20
    assert ends_at_zero(rig)


def test_nan_from_the_controller_ends_the_flight(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    nothing = ((float("nan"), 0.0), (0.0, 0.0))
    monkeypatch.setattr(Controller, "step", lambda self, *a: nothing)
    rig = ScriptedRig()
    outcome, _ = flown(rig)
    assert outcome.ending == "tripped"
    assert "nan V on the front motor" in outcome.detail


def test_a_recorder_that_fails_does_not_prevent_the_ramp_to_zero() -> None:
    class Full(MemoryRecorder):
        def append(self, row: object) -> None:
            if len(self.rows) == 30:
                raise OSError("no space left")
            super().append(row)

    rig = ScriptedRig()
    plan = step_plan((0.0, None, None), settle_s=0, duration_s=0.2)
    outcome = fly(rig, PROFILE, plan.render(DT, 0), Full())
    assert outcome.ending == "error"
    assert "no space left" in outcome.detail
    assert ends_at_zero(rig)
    assert outcome.landed


def test_a_device_that_does_not_answer_is_stopped_without_a_ramp() -> None:
    def gone(k: int, sample: Sample) -> Sample:
        if k == 30:
            raise DeviceError("the cable is out")
        return sample

    rig = ScriptedRig(gone)
    outcome, sink = flown(rig)
    assert (outcome.ending, outcome.detail, outcome.landed) == ("device", "the cable is out", False)
    assert rig.stopped
    assert all(r.phase == CLOSED_LOOP for r in sink.rows)


def test_missed_periods_are_skipped() -> None:
    # The sample of period 10 comes 5.5 periods late, on a rig that the host times.
    rig = ScriptedRig(late=lambda k: 5.5 * DT if k == 10 else 0.0, timebase="host")
    outcome, sink = flown(rig)
    assert outcome.missed == 5
    assert outcome.late == 1
    assert outcome.periods == 95
    assert outcome.worst_lateness_s == pytest.approx(5.5 * DT)
    t = np.array([r.t for r in sink.rows if r.phase == CLOSED_LOOP])
    assert np.diff(t).min() > 0.4 * DT
    # Later samples are on the old grid again.
    np.testing.assert_allclose(np.mod(t[12:] + DT / 2, DT), DT / 2, atol=1e-9)


def test_lost_samples_are_skipped_and_the_references_keep_wall_time() -> None:
    # Device-timed: no sample comes for periods 10 and 11.
    rig = ScriptedRig(late=lambda k: 2 * DT if k == 10 else 0.0)
    ramp = step_plan((5.0, None, None), settle_s=0, duration_s=100 * DT).render(DT, 0)
    ramp.reference[:, 0] = np.arange(len(ramp.reference)) * 1e-4
    sink = MemoryRecorder()
    outcome = fly(rig, PROFILE, ramp, sink)
    assert (outcome.lost + outcome.missed, outcome.periods) == (2, 98)
    rows = [r for r in sink.rows if r.phase == CLOSED_LOOP]
    t = np.array([r.t for r in rows])
    np.testing.assert_allclose([r.reference[0] for r in rows], t / DT * 1e-4, atol=1e-12)


def test_a_gap_of_samples_across_the_plans_end_is_judged() -> None:
    rig = ScriptedRig(late=lambda k: 40 * DT if k == 80 else 0.0)
    outcome, _ = flown(rig, monitors=[lambda now: "a gap" if now.skipped > 25 else None])
    assert (outcome.ending, outcome.detail, outcome.periods) == ("tripped", "a gap", 80)


def test_an_emergency_stop_in_the_landing_is_no_completed_plan() -> None:
    rig = ScriptedRig()
    reason = Trip("emergency stop, by a second Ctrl-C", "a second signal.", "start again")
    outcome, _ = flown(rig, stop_without_ramp=lambda: reason)
    assert outcome.detail == "the landing was cut short; emergency stop, by a second Ctrl-C"
    assert outcome.advice()["fix"] == "start again"


@pytest.mark.parametrize(("skipped", "bridged"), [(15, 500), (40, 30)])
def test_skipped_periods_do_not_change_the_rate_of_a_steady_turn(
    skipped: int, bridged: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Yaw turns at 40°/s, also during the periods without a sample.
    monkeypatch.setattr("heli3dof.experiment.control_loop.loop.BRIDGED", bridged)

    def turning(k: int, s: Sample) -> Sample:
        yaw = round(np.radians(40.0) * s.device_time_s / abs(PROFILE.encoder.rad_per_count[2]))
        return replace(s, counts=(s.counts[0], s.counts[1], yaw))

    rig = ScriptedRig(turning, late=lambda k: skipped * DT if k == 50 else 0.0)
    seen: list[float] = []
    loose = PROFILE.limits.model_copy(update={"slew_max_V_per_s": 1e6})
    loose = PROFILE.model_copy(update={"limits": loose})
    flown(rig, profile=loose, monitors=[lambda now: seen.append(now.rate[2])])
    after = np.degrees(np.abs(seen[50:60]))
    assert abs(after - 40.0).max() < 8.0  # counts are 0.044° apart, 22°/s in one period


def test_lost_samples_do_not_lengthen_the_ramp() -> None:
    rig = ScriptedRig(late=lambda k: 20 * DT if k == 60 else 0.0)
    reasons = iter([None] * 50 + ["stopped with Ctrl-C"] * 1000)
    _, sink = flown(rig, stop=lambda: next(reasons))
    ramp = [r for r in sink.rows if r.phase == RAMP_DOWN]
    assert ends_at_zero(rig)
    # The ramp learns of the lost samples one period after them.
    assert ramp[-1].t - ramp[0].t <= PROFILE.limits.ramp_down_s + DT
    assert len(ramp) == round(PROFILE.limits.ramp_down_s / DT) - 20


def test_a_ramp_after_lost_samples_begins_at_the_last_voltage() -> None:
    # The flight ends by the first sample after 200 lost ones.
    rig = ScriptedRig(late=lambda k: 200 * DT if k == 60 else 0.0)
    _, sink = flown(rig, periods=500, monitors=[lambda now: "lost" if now.skipped else None])
    ramp = [r for r in sink.rows if r.phase == RAMP_DOWN]
    n = round(PROFILE.limits.ramp_down_s / DT)
    front = [r.voltage[0] for r in sink.rows if r.phase == CLOSED_LOOP][-1]
    np.testing.assert_allclose([r.voltage[0] for r in ramp], front * (1 - np.arange(1, n + 1) / n))


def test_a_ramp_that_fails_after_a_completed_plan_is_the_outcome() -> None:
    def gone(k: int, sample: Sample) -> Sample:
        if k == 150:
            raise DeviceError("the cable is out")
        return sample

    rig = ScriptedRig(gone)
    outcome, _ = flown(rig)
    assert (outcome.ending, outcome.landed) == ("device", False)
    assert outcome.detail == "the ramp to zero failed: the cable is out"
    assert rig.stopped


def test_the_outcome_holds_the_punctuality_of_the_loop() -> None:
    rig = ScriptedRig(late=lambda k: 0.0005 if k % 10 == 0 else 0.0, timebase="host")
    outcome, _ = flown(rig)
    result = outcome.punctuality
    assert result.median_s == pytest.approx(0, abs=1e-9)
    assert result.p99_s == result.worst_s == pytest.approx(0.0005)
    assert result.late_share == 0
    assert outcome.realtime is not None
    kept = outcome.details()
    assert kept["punctuality"]["worst_s"] == result.worst_s
    assert set(kept["realtime"]) == {"scheduled", "memory_locked", "found", "refused"}


def test_on_a_virtual_clock_there_are_no_real_time_measures_and_no_lateness() -> None:
    outcome, _ = flown(ScriptedRig(timebase="virtual"))
    assert (outcome.realtime, outcome.punctuality, outcome.late) == (None, None, 0)


def test_the_links_counts_are_part_of_the_outcome() -> None:
    class Rig(ScriptedRig):
        statistics = LinkStatistics(lost=3, malformed=2)

    Rig.statistics.delay.add(120e-6)
    link = flown(Rig())[0].details()["link"]
    assert (link["lost"], link["malformed"]) == (3, 2)
    assert link["delay_median_s"] == pytest.approx(120e-6)
    assert "round_trip_median_s" not in link, "nothing was counted"
    assert flown(ScriptedRig())[0].link is None
