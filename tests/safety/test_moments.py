"""The measurement of every row at random moments: its draws, and its ability to fail."""

from __future__ import annotations

import pytest

from tests.bench.bench_safety import in_time, made
from tests.safety.moments import (
    CALM,
    EMULATED,
    FIRMWARE,
    MOCK_FAULTS,
    NEED_A_PROCESS,
    SABOTAGE,
    SIGNALS,
    SWITCHES,
    Case,
    Run,
    cases,
    fly,
    span_s,
)
from tests.safety.table import BY_NAME


def test_every_row_has_moments_on_both_devices() -> None:
    drawn = {(c.row, c.device, c.number) for c in cases(3)}
    assert {(row, d, i) for row in BY_NAME for d in (EMULATED, FIRMWARE) for i in range(3)} <= drawn


def test_every_part_of_the_flight_has_a_moment() -> None:
    for case in cases(10):
        if case.row != CALM:
            part_s = span_s(case) / 10
            part = case.moment_s / part_s - case.number
            assert -0.01 <= part <= 1.01  # whole milliseconds


def test_the_moments_are_reproducible() -> None:
    assert cases(4) == cases(4)


def test_every_row_can_be_caused_on_the_emulated_rig() -> None:
    assert set(BY_NAME) == {*SIGNALS, *SABOTAGE, *MOCK_FAULTS, *NEED_A_PROCESS}
    assert set(SWITCHES) <= set(BY_NAME)
    assert all(made(row) for row in BY_NAME)


@pytest.mark.parametrize("at_s", [1.0, 5.0])
def test_an_interrupted_flight_ends_as_in_the_table(at_s: float) -> None:
    run = fly(Case("ctrl_c", EMULATED, 1, at_s))
    assert (run.wrong, run.as_claimed, run.in_flight, in_time(run)) == ([], True, True, True)
    assert run.took_s == pytest.approx(0.5, abs=0.01)
    assert run.table_deg_per_s is not None


def test_a_moment_after_the_ramp_is_not_in_flight() -> None:
    assert not fly(Case("button", EMULATED, 1, 7.5)).in_flight


def test_a_ramp_that_takes_too_long_is_detected() -> None:
    run = Run(Case("ctrl_c", EMULATED, 0, 1.0), since_s=1.0, zero_s=1.6, bound_s=0.502)
    assert not in_time(run)
    run.late_s = 0.05  # at the beginning and at the end of the ramp
    assert in_time(run)


def test_another_outcome_is_detected() -> None:
    run = Run(Case("ctrl_c", EMULATED, 0, 1.0), code=0, ending="completed", detail="")
    assert not run.as_claimed
