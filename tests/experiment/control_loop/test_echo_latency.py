"""Command-to-echo latency, measured by the host in s and whole periods."""

from __future__ import annotations

import pytest

from heli3dof.experiment.control_loop.echo_latency import EchoLatency, EchoMeter
from heli3dof.rig.interface import Flags, Sample
from tests.experiment.control_loop.test_loop import DT, ScriptedRig, flown

TURN_S = 100e-6


def sample(echo: int, came_s: float, flags: Flags = Flags.ENABLED) -> Sample:
    return Sample(echo, came_s, (0, 0, 0), (0.0, 0.0), (0.0, 0.0), flags, came_s)


def measured(behind: int, periods: int = 1000) -> EchoLatency:
    """A rig whose sample k echoes command k − ``behind``."""
    meter = EchoMeter(DT)
    for k in range(1, periods + 1):
        meter.exchanged(k, (k - 1) * DT + TURN_S, sample(max(0, k - behind), k * DT))
    result = meter.measured()
    assert result is not None
    return result


def test_a_rig_without_delay_takes_a_period_less_the_controllers_time() -> None:
    result = measured(0)
    assert result.median_s == pytest.approx(DT - TURN_S, rel=0.01)
    assert (result.median_periods, result.p999_periods, result.worst_periods) == (1, 1, 1)
    assert (result.commands, result.commands_unacknowledged, result.commands_never_echoed) == (
        1000, 0, 0,
    )  # fmt: skip


@pytest.mark.parametrize("behind", [1, 2, 12])
def test_constant_latency_is_not_measured_modulo_the_period(behind: int) -> None:
    result = measured(behind)
    assert result.median_s == pytest.approx((1 + behind) * DT - TURN_S, rel=0.01)
    assert result.median_periods == 1 + behind
    assert result.commands_unacknowledged == result.commands
    assert result.commands_never_echoed == 0


def test_a_lost_command_is_unacknowledged_and_never_echoed() -> None:
    meter = EchoMeter(DT)
    for k in range(1, 101):
        lost = k % 10 == 0 and k < 100
        meter.exchanged(k, k * DT, sample(k - lost, (k + 1) * DT))
    result = meter.measured()
    assert result is not None
    assert (result.commands_unacknowledged, result.commands_never_echoed) == (9, 9)


def test_commands_to_a_device_that_stops_listening_were_never_echoed() -> None:
    meter = EchoMeter(DT)
    for k in range(1, 101):
        meter.exchanged(k, k * DT, sample(min(k, 53), (k + 1) * DT))
    result = meter.measured()
    assert result is not None
    assert (result.commands_unacknowledged, result.commands_never_echoed) == (47, 47)


def test_the_worst_latency_is_exact() -> None:
    meter = EchoMeter(DT)
    for k in range(1, 101):
        meter.exchanged(k, k * DT, sample(k, k * DT + (0.0314 if k == 50 else DT)))
    assert meter.measured().worst_s == pytest.approx(0.0314)  # type: ignore[union-attr]
    assert meter.measured().worst_periods == 16  # type: ignore[union-attr]


def test_commands_to_a_stopped_device_are_not_counted() -> None:
    meter = EchoMeter(DT)
    for k in range(1, 11):
        meter.exchanged(k, k * DT, sample(0, (k + 1) * DT, Flags.LATCHED))
    assert meter.measured() is None


@pytest.mark.parametrize("echo", [-1, 7, 2**31, 2**32 - 1])
def test_an_echo_of_a_command_never_sent_is_not_timed(echo: int) -> None:
    meter = EchoMeter(DT)
    meter.exchanged(1, 0.0, sample(echo, DT))
    result = meter.measured()
    assert result is not None
    assert (result.median_s, result.commands_unacknowledged) == (None, 1)


def test_every_flight_records_its_latency() -> None:
    outcome, _ = flown(ScriptedRig())
    kept = outcome.details()["latency"]
    assert kept["commands"] > 100
    assert kept["commands_unacknowledged"] == 0
    assert kept["median_periods"] >= 1


def test_on_a_virtual_clock_commands_are_counted_and_not_timed() -> None:
    outcome, _ = flown(ScriptedRig(timebase="virtual"))
    kept = outcome.details()["latency"]
    assert (kept["median_s"], kept["commands_unacknowledged"]) == (None, 0)
