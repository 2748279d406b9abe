"""A flight ends as tripped when the device stops on its own, in flight or in the ramp."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from heli3dof.experiment.control_loop.stop_reasons import explain
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import step_plan
from heli3dof.recording.row import RAMP_DOWN
from heli3dof.rig.interface import Flags, Sample
from tests.experiment.control_loop.test_loop import DT, PROFILE, ScriptedRig, flown

RAMP = round(PROFILE.limits.landing_s / DT)


def flagged(flag: Flags, since: int) -> Callable[[int, Sample], Sample]:
    return lambda k, s: replace(s, flags=flag) if k >= since else s


@pytest.mark.parametrize(
    ("flag", "message"),
    [
        (Flags.LATCHED, "the device's watchdog expired"),
        (Flags.FAULT, "the amplifier reports a fault"),
        (Flags.STALL, "a motor is stalled"),
        (Flags.ESTOP, "an emergency stop is in force"),
    ],
)
def test_a_device_that_stops_during_the_ramp_trips_the_flight(flag: Flags, message: str) -> None:
    outcome, sink = flown(ScriptedRig(flagged(flag, 150)))
    assert (outcome.ending, outcome.landed) == ("tripped", False)
    assert message in outcome.detail
    assert len([r for r in sink.rows if r.phase == RAMP_DOWN]) == RAMP, "samples are still recorded"


def test_a_device_that_stops_in_the_last_period_trips_the_flight() -> None:
    outcome, _ = flown(ScriptedRig(flagged(Flags.FAULT, 100)))
    assert outcome.ending == "tripped"
    assert "the amplifier reports a fault" in outcome.detail


def test_the_reason_is_reported_once() -> None:
    outcome, _ = flown(ScriptedRig(flagged(Flags.STALL, 40)))
    assert outcome.detail == "a motor is stalled"


def test_a_device_that_stops_in_the_ramp_after_ctrl_c_is_reported_too() -> None:
    reasons = iter([None] * 50 + ["stopped with Ctrl-C"] * 1000)
    outcome, _ = flown(ScriptedRig(flagged(Flags.FAULT, 60)), stop=lambda: next(reasons))
    assert outcome.ending == "tripped"
    assert outcome.detail == "stopped with Ctrl-C; the amplifier reports a fault"


def test_the_reports_of_monitor_and_device_are_joined() -> None:
    outcome, _ = flown(
        ScriptedRig(flagged(Flags.LATCHED, 40)),
        monitors=[lambda now: "the computer slept for 3 s" if now.k == 40 else None],
    )
    assert outcome.detail.startswith("the device's watchdog expired")
    assert outcome.detail.endswith("; the computer slept for 3 s")


def test_a_watchdogs_report_states_the_longest_exchange_and_names_a_slow_device() -> None:
    trip = explain(int(Flags.LATCHED), None, 0.101)
    assert trip is not None
    assert "the longest exchange with the device took 101 ms" in trip
    assert trip.cause.startswith("the device or the line was too slow")
    outcome, _ = flown(ScriptedRig(flagged(Flags.LATCHED, 40)))
    assert "the longest exchange with the device took" in outcome.detail


def test_monitors_judge_before_the_envelope() -> None:
    rig = ScriptedRig(lambda k, s: replace(s, counts=(s.counts[0] + 400, 0, 0)) if k > 40 else s)
    outcome, _ = flown(rig, monitors=[lambda now: "jumped" if now.k == 41 else None])
    assert outcome.detail == "jumped"


class StatingRig(ScriptedRig):
    """A rig that states why its output is held at zero."""

    device_cause = "OVERCURRENT"


def test_the_cause_that_the_device_states_is_reported_and_recorded() -> None:
    outcome, _ = flown(StatingRig(flagged(Flags.FAULT, 40)))
    assert outcome.detail == "the amplifier reports a fault (the device states: OVERCURRENT)"
    assert outcome.details()["device_cause"] == "OVERCURRENT"
    assert "turn both rotors by hand" in outcome.advice()["fix"]


def test_a_cause_stated_during_the_ramp_is_reported() -> None:
    outcome, _ = flown(StatingRig(flagged(Flags.FAULT, 150)))
    assert "(the device states: OVERCURRENT)" in outcome.detail


def test_an_unknown_cause_is_reported_with_the_flags_advice() -> None:
    trip = explain(int(Flags.FAULT), "COOLANT")
    assert trip is not None
    assert trip == "the amplifier reports a fault (the device states: COOLANT)"
    assert trip.cause == explain(int(Flags.FAULT)).cause  # type: ignore[union-attr]


def test_a_rig_that_states_no_cause_records_none() -> None:
    outcome, _ = flown(ScriptedRig(flagged(Flags.FAULT, 40)))
    assert outcome.details()["device_cause"] is None


@pytest.mark.parametrize(
    ("fault", "stated"),
    [
        ("overcurrent", "OVERCURRENT"),
        ("overtemperature", "OVERTEMPERATURE"),
        ("stall", "STALL"),
        ("button", "BUTTON"),
    ],
)
def test_the_cause_of_the_emulated_rig_is_in_the_outcome(fault: str, stated: str) -> None:
    plan = step_plan((0.0, None, None), settle_s=0, duration_s=1)
    flight = fly_plan(plan, device=f"mock:?speed=max&fault={fault}@0.5")
    assert flight.outcome.ending == "tripped"
    assert f"(the device states: {stated})" in flight.outcome.detail
    assert flight.recording.meta["outcome_details"]["device_cause"] == stated
