"""An amplifier that is off, or ignores the commands, ends the flight."""

from __future__ import annotations

from collections.abc import Iterable
from math import inf, nan

import pytest

from heli3dof.experiment.control_loop.control_period import Period
from heli3dof.experiment.safety_monitors.amplifier_output import SAMPLES, AmplifierOutput
from heli3dof.rig.interface import Flags
from heli3dof.rig.trip import Trip
from tests.experiment.safety_monitors.periods import HOVER, PROFILE, period

ENABLED, OFF = Flags.ENABLED, Flags(0)


def first_report(periods: Iterable[Period]) -> str | None:
    monitor = AmplifierOutput(PROFILE)
    return next(filter(None, map(monitor, periods)), None)


def commanded(k: int, volts: float, applied: float, **changed: object) -> Period:
    return period(k, v_applied=(applied, HOVER), sent=(volts, HOVER), **changed)


def test_an_amplifier_that_is_disabled_in_flight_ends_it_at_once() -> None:
    monitor = AmplifierOutput(PROFILE)
    assert monitor(period(0)) is None
    assert monitor.stop_without_ramp() is None
    report = monitor(period(1, flags=OFF))
    assert isinstance(report, Trip)
    assert "does not report ENABLED any more" in report
    assert "its output" in (monitor.stop_without_ramp() or "")


@pytest.mark.parametrize("stop", [Flags.LATCHED, Flags.ESTOP, Flags.FAULT, Flags.STALL])
def test_a_stop_that_the_device_states_is_not_reported_twice(stop: Flags) -> None:
    periods = (commanded(k, HOVER, HOVER if k < 9 else 0.0, flags=stop if k >= 9 else ENABLED)
               for k in range(500))  # fmt: skip
    assert first_report(periods) is None


def test_a_driver_that_never_reports_enabled_is_not_judged_by_it() -> None:
    assert first_report(period(k, flags=OFF) for k in range(500)) is None


def test_zero_volts_at_a_command_are_reported() -> None:
    periods = (commanded(k, HOVER, HOVER if k < 100 else 0.0) for k in range(500))
    report = first_report(periods)
    assert report is not None
    assert "the front motor's output is 0.0 V at a command of 7.5 V" in report
    assert f"not followed the commands for {SAMPLES + 1} samples" in report


def test_an_output_that_stays_on_is_reported() -> None:
    assert first_report(commanded(k, 0.0, 5.0) for k in range(500)) is not None


@pytest.mark.parametrize(
    "changed", [{"flags": ENABLED | Flags.SATURATED}, {"applied": nan}, {"applied": inf}]
)
def test_a_clipped_or_unmeasured_output_is_not_judged(changed: dict[str, object]) -> None:
    values = {"volts": 24.0, "applied": 6.0} | changed
    assert first_report(commanded(k, **values) for k in range(500)) is None  # type: ignore[arg-type]


def test_an_output_that_is_a_quarter_low_is_not_reported() -> None:
    assert first_report(commanded(k, 24.0, 18.0) for k in range(500)) is None


def test_steps_and_ramps_over_a_slow_link_are_not_reported() -> None:
    """The output follows the commands 40 periods later."""
    sent = [0.0] + [24.0 if k // 60 % 2 else -24.0 for k in range(1000)] + [0.0] * 200
    delayed = [0.0] * 40 + sent
    periods = (commanded(k, v, delayed[k], skipped=40 * (k % 7 == 0)) for k, v in enumerate(sent))
    assert first_report(periods) is None


def test_an_exchange_that_the_host_delayed_is_one_sample() -> None:
    periods = (commanded(200 * k, HOVER, 0.0, skipped=199) for k in range(SAMPLES))
    assert first_report(periods) is None
