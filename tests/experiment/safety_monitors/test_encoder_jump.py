"""A count that jumps is reported; motion within the envelope is not."""

from __future__ import annotations

from collections.abc import Callable
from math import pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from heli3dof.experiment.safety_monitors.encoder_jump import EncoderJump
from tests.experiment.safety_monitors.periods import DT, LEVEL, PROFILE, period

RATES = (150.0, 400.0, 200.0)


def first(monitor: Callable, periods: Callable[[int], object], n: int) -> tuple[int, str] | None:
    """The period of the first report, and the report."""
    for k in range(n):
        report = monitor(periods(k))
        if report is not None:
            return k, report
    return None


@pytest.mark.parametrize(("axis", "name"), [(0, "roll"), (1, "pitch"), (2, "yaw")])
def test_a_jump_is_reported_in_its_own_period(axis: int, name: str) -> None:
    def jumped(k: int):
        counts = [LEVEL, 0, 0]
        counts[axis] += -60 if k >= 40 else 0
        return period(k, counts=(counts[0], counts[1], counts[2]))

    result = first(EncoderJump(PROFILE), jumped, 100)
    assert result is not None
    assert result[0] == 40
    assert f"the {name} encoder jumped by -60 counts within 2.0 ms" in result[1]


@given(
    rates=st.lists(st.tuples(*(st.floats(-1, 1) for _ in range(3))), min_size=5, max_size=60),
    gap=st.integers(1, 50),
)
def test_motion_within_the_envelope_is_no_jump(rates: list, gap: int) -> None:
    monitor = EncoderJump(PROFILE)
    angle = [0.0, 0.0, 0.0]
    q = PROFILE.encoder.rad_per_count * 180 / pi
    for n, rate in enumerate(rates):
        angle = [angle[i] + rate[i] * RATES[i] * DT * gap for i in range(3)]
        counts = tuple(round(a / q[i]) for i, a in enumerate(angle))
        assert monitor(period(n * gap, counts=counts)) is None  # type: ignore[arg-type]


def test_a_jump_across_lost_samples_is_judged_by_the_elapsed_time() -> None:
    monitor = EncoderJump(PROFILE)
    monitor(period(0))
    assert monitor(period(50, counts=(LEVEL + 100, 0, 0))) is None
    assert monitor(period(51, counts=(LEVEL, 0, 0))) is not None


def test_time_that_runs_backwards_is_reported() -> None:
    monitor = EncoderJump(PROFILE)
    monitor(period(50))
    report = monitor(period(49))
    assert report is not None
    assert "time ran backwards: by 2.0 ms" in report


def test_constant_device_time_is_reported_after_a_quarter_of_a_second() -> None:
    result = first(EncoderJump(PROFILE), lambda k: period(k)._replace(t=min(k, 100) * DT), 1000)
    assert result is not None
    assert 225 <= result[0] <= 227
    assert "time stayed at 0.200 s" in result[1]


def test_constant_device_time_is_reported_in_the_ramp_too() -> None:
    """All periods of the ramp have the index of the plan's last period."""
    result = first(EncoderJump(PROFILE), lambda k: period(min(k, 100)), 1000)
    assert result is not None
    assert 225 <= result[0] <= 227


def test_a_clock_that_advances_every_eighth_period_is_no_fault() -> None:
    assert (
        first(EncoderJump(PROFILE), lambda k: period(k)._replace(t=k // 8 * 8 * DT), 1000) is None
    )


@pytest.mark.parametrize("bits", [16, 24])
@pytest.mark.parametrize("sign", [-1, 1])
def test_a_counter_that_wraps_is_identified(bits: int, sign: int) -> None:
    monitor = EncoderJump(PROFILE)
    monitor(period(0))
    report = monitor(period(1, counts=(LEVEL, 0, sign * (2**bits - 1))))
    assert report is not None
    assert f"about 2^{bits}" in report
    assert f"counter has {bits} bits" in report.cause
