"""The motors are ramped to zero from hover, and go to zero at once from other voltages."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
import pytest

from heli3dof.experiment.control_loop.control_period import Period
from heli3dof.experiment.control_loop.loop import fly
from heli3dof.experiment.control_loop.outcome import Outcome
from heli3dof.experiment.control_loop.ramp_down import HOVER_BAND, ramp_start
from heli3dof.experiment.fly import prepare
from heli3dof.experiment.plan import step_plan
from heli3dof.model.control.controller import Controller
from heli3dof.recording.memory import MemoryRecorder
from heli3dof.recording.row import RAMP_DOWN, Row
from heli3dof.rig.drivers import open_driver
from heli3dof.rig.interface import Command, Flags, Sample
from heli3dof.rig.profile import Motor
from heli3dof.rig.trip import Trip
from tests.experiment.control_loop.test_loop import (
    DT,
    PROFILE,
    ROLL_UP_ONE_DEGREE,
    ScriptedRig,
    ends_at_zero,
    flown,
)
from tests.experiment.safety_monitors.periods import Judging

MOTOR = PROFILE.motor
V_O = MOTOR.V_o
LIMITS = PROFILE.limits.model_copy(update={"slew_max_V_per_s": 1e6})
STEEP = PROFILE.model_copy(update={"limits": LIMITS})
"""A profile without a slew limit: the voltage may jump"""
SATURATIONS = [(50.0, 50.0), (-50.0, -50.0), (50.0, -50.0), (-50.0, 50.0), (50.0, 0.0)]
"""V that the plan adds: up, down, to either side, one motor only"""


@pytest.mark.parametrize(
    "last",
    [(V_O, V_O), (V_O + 2, V_O - 2), (1.49 * V_O, 1.49 * V_O), (0.51 * V_O, 0.51 * V_O)],
)
def test_the_ramp_starts_at_voltages_near_hover(last: tuple[float, float]) -> None:
    assert ramp_start(last, MOTOR) == last


@pytest.mark.parametrize(
    "last",
    [
        (24.0, 24.0), (-24.0, -24.0), (24.0, -24.0), (24.0, V_O), (V_O, 24.0), (V_O, 0.0),
        (1.51 * V_O, V_O), (V_O, 0.49 * V_O), (float("nan"), V_O), (V_O, float("inf")),
    ],
)  # fmt: skip
def test_one_motor_far_from_hover_sends_both_to_zero_at_once(last: tuple[float, float]) -> None:
    assert ramp_start(last, MOTOR) == (0.0, 0.0)


def test_negative_hover_voltages_are_ramped() -> None:
    motor = Motor(K_f=0.1, V_o=-6.0, v_max=24.0)
    assert ramp_start((-6.5, -5.5), motor) == (-6.5, -5.5)
    assert ramp_start((6.0, 6.0), motor) == (0.0, 0.0)


def test_a_balanced_arm_is_ramped_from_small_voltages_of_either_sign() -> None:
    motor = Motor(K_f=0.1, V_o=0.0, v_max=24.0)
    small = HOVER_BAND * 24.0 / 8
    assert ramp_start((small, -small), motor) == (small, -small)
    assert ramp_start((1.01 * small, 0.0), motor) == (0.0, 0.0)


def test_a_rig_20_percent_off_its_profile_hovers_inside_the_band() -> None:
    for gain in (0.8, 1.2):
        for trim in (0.8, 1.2):
            hover = V_O * trim / gain
            assert ramp_start((hover, hover), MOTOR) == (hover, hover)


def saturated(
    rig: ScriptedRig, extra: tuple[float, float], since: int = 40,
    monitors: Iterable[Callable[[Period], object]] = (), **keys: object,
) -> tuple[Outcome, list[Row]]:  # fmt: skip
    """A flight of 100 periods whose plan adds these volts from ``since`` on, and its ramp."""
    signals = step_plan((0.0, None, None), settle_s=0, duration_s=100 * DT).render(DT, 0)
    signals.extra[since:] = extra
    sink = MemoryRecorder()
    outcome = fly(rig, STEEP, signals, sink, monitors=[Judging(m) for m in monitors], **keys)
    return outcome, [row for row in sink.rows if row.phase == RAMP_DOWN]


def at_zero_at_once(rig: ScriptedRig, ramp: list[Row], seconds: float) -> bool:
    """Zero volts after the end, and samples for the time of the ramp."""
    return (
        ends_at_zero(rig)
        and len(ramp) == round(seconds / DT)
        and all(row.voltage == (0.0, 0.0) for row in ramp)
    )


@pytest.mark.parametrize("extra", SATURATIONS)
def test_a_trip_at_saturation_takes_the_motors_to_zero_at_once(extra: tuple[float, float]) -> None:
    rig = ScriptedRig()
    outcome, ramp = saturated(rig, extra, monitors=[lambda now: "seen" if now.k == 60 else None])
    assert (outcome.ending, outcome.landed, outcome.ramped) == ("tripped", True, False)
    assert max(abs(rig.commands[59].v_front), abs(rig.commands[59].v_back)) == MOTOR.v_max
    assert at_zero_at_once(rig, ramp, LIMITS.ramp_down_s)


@pytest.mark.parametrize("extra", SATURATIONS)
def test_ctrl_c_at_saturation_takes_the_motors_to_zero_at_once(extra: tuple[float, float]) -> None:
    reasons = iter([None] * 60 + ["stopped with Ctrl-C"] * 1000)
    rig = ScriptedRig()
    outcome, ramp = saturated(rig, extra, stop=lambda: next(reasons))
    assert (outcome.ending, outcome.landed, outcome.ramped) == ("interrupted", True, False)
    assert at_zero_at_once(rig, ramp, LIMITS.ramp_down_s)


def test_an_error_in_the_controller_at_saturation_takes_the_motors_to_zero_at_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    calls = iter(range(1000))
    step = Controller.step

    def broken(self: Controller, *a: object) -> object:
        if next(calls) == 60:
            raise ZeroDivisionError("division by zero")
        return step(self, *a)

    monkeypatch.setattr(Controller, "step", broken)
    rig = ScriptedRig()
    outcome, ramp = saturated(rig, (50.0, 50.0))
    assert (outcome.ending, outcome.periods) == ("error", 60)
    assert at_zero_at_once(rig, ramp, LIMITS.ramp_down_s)


@pytest.mark.parametrize("flag", [Flags.FAULT, Flags.LATCHED, Flags.STALL])
def test_a_device_that_stops_at_saturation_is_commanded_to_zero_at_once(flag: Flags) -> None:
    rig = ScriptedRig(lambda k, s: replace(s, flags=s.flags | flag) if k >= 60 else s)
    outcome, ramp = saturated(rig, (50.0, 50.0))
    assert outcome.ending == "tripped"
    assert at_zero_at_once(rig, ramp, LIMITS.ramp_down_s)


def test_a_device_that_clips_at_saturation_changes_nothing() -> None:
    rig = ScriptedRig(lambda k, s: replace(s, flags=s.flags | Flags.SATURATED))
    monitors = [lambda now: "seen" if now.k == 60 else None]
    _, ramp = saturated(rig, (50.0, 50.0), monitors=monitors)
    assert at_zero_at_once(rig, ramp, LIMITS.ramp_down_s)


def test_a_plan_that_ends_at_saturation_takes_the_motors_to_zero_at_once() -> None:
    rig = ScriptedRig()
    outcome, ramp = saturated(rig, (50.0, 50.0))
    assert (outcome.ending, outcome.landed) == ("completed", True)
    assert at_zero_at_once(rig, ramp, LIMITS.landing_s)


def test_ctrl_c_in_hover_ramps_to_zero() -> None:
    reasons = iter([None] * 60 + ["stopped with Ctrl-C"] * 1000)
    rig = ScriptedRig()
    outcome, ramp = saturated(rig, (1.0, -1.0), stop=lambda: next(reasons))
    assert (outcome.ending, outcome.landed, outcome.ramped) == ("interrupted", True, True)
    n = round(LIMITS.ramp_down_s / DT)
    np.testing.assert_allclose(
        [row.voltage for row in ramp],
        np.outer(1 - np.arange(1, n + 1) / n, [rig.commands[59].v_front, rig.commands[59].v_back]),
    )


def highest_after_the_trip_deg(device: str) -> float:
    """° by which the true roll climbs above its value at the trip, until it is on the table."""
    profile = PROFILE.with_controller()
    sink = MemoryRecorder()
    rig = open_driver(device, profile)
    signals = prepare(step_plan((10.0, None, None), settle_s=0, duration_s=5.0), profile, 0)
    outcome = fly(rig, profile, signals, sink)
    assert outcome.ending == "tripped"
    roll = [rig.truth.angle[0]]
    for sequence in range(2000):
        rig.exchange(Command(10_000 + sequence, 0.0, 0.0), 0.0)
        roll.append(rig.truth.angle[0])
    # The encoder counts the wrong way from rest, so the true angle has the other sign.
    seen = [-row.sample.counts[0] / ROLL_UP_ONE_DEGREE - 27.5 for row in sink.rows]
    at_trip = next(deg for deg, row in zip(seen, sink.rows, strict=True) if row.phase == RAMP_DOWN)
    assert np.degrees(roll[-1]) == pytest.approx(-27.5, abs=0.1)
    return max(*seen, *np.degrees(roll)) - at_trip


def test_a_device_that_puts_out_volts_after_the_ramp_is_stopped() -> None:
    def hot(k: int, sample: Sample) -> Sample:
        return replace(sample, v_applied=(2.05, 1.87))

    rig, landing = ScriptedRig(hot), round(PROFILE.limits.landing_s / DT)
    outcome, _ = flown(rig)
    assert (outcome.ending, outcome.landed) == ("tripped", False)
    assert "the device still reported an output of 2.05 and 1.87 V" in outcome.detail
    assert outcome.advice()["fix"].startswith("press the amplifier's button")
    assert len(rig.stopped) == 1
    assert len(rig.commands) == 100 + landing + 50, "0.1 s for a slow link"


def test_a_trip_with_an_output_that_stays_on_states_both() -> None:
    def hot(k: int, sample: Sample) -> Sample:
        return replace(sample, v_applied=(2.05, 1.87))

    rig = ScriptedRig(hot)
    outcome, _ = flown(rig, monitors=(lambda now: Trip("why") if now.k == 50 else None,))
    assert outcome.ending == "tripped"
    assert outcome.detail.startswith(
        "why; after the ramp to zero the device still reported an output of"
    )
    assert rig.stopped


@pytest.mark.parametrize("volts", [(0.5, -0.5), (np.nan, np.nan), (np.inf, 0.0)], ids=str)
def test_a_small_or_unmeasured_output_after_the_ramp_is_zero(volts: tuple[float, float]) -> None:
    rig = ScriptedRig(lambda k, sample: replace(sample, v_applied=volts))
    outcome, _ = flown(rig)
    assert (outcome.ending, rig.stopped) == ("completed", [])


def test_an_output_that_reaches_zero_late_is_zero() -> None:
    """The output follows the commands 30 periods later."""
    rig = ScriptedRig()

    def late(k: int, sample: Sample) -> Sample:
        past = rig.commands[-31] if k > 30 else None
        return replace(sample, v_applied=(past.v_front, past.v_back) if past else (0.0, 0.0))

    rig.script = late
    short = PROFILE.model_copy(update={"limits": LIMITS.model_copy(update={"landing_s": 0.02})})
    outcome, _ = flown(rig, profile=short)
    assert (outcome.ending, rig.stopped) == ("completed", [])


def test_the_index_of_the_ramp_is_the_plans_length_also_after_skipped_periods() -> None:
    rig = ScriptedRig(late=lambda k: 5.5 * DT if k == 10 else 0.0, timebase="host")
    seen: list[Period] = []
    flown(rig, monitors=[seen.append])
    assert [now.k for now in seen if not now.ramping_down] == [*range(10), *range(15, 100)]
    assert {now.k for now in seen if now.ramping_down} == {100}


def test_a_wrong_roll_sign_does_not_throw_the_arm() -> None:
    """24 V at the trip at −23°: a ramp of half a second would throw it by 54°, to +31°."""
    assert 5.0 < highest_after_the_trip_deg("mock:?speed=max&seed=1&fault=reversed.roll@0") < 16.0
