"""A count that jumps or stands still is seen; a rig that merely hovers, sticks or rests is not."""

from __future__ import annotations

from collections.abc import Callable
from math import pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from heli3dof.experiment.watches import Frozen, Jump
from tests.experiment.watches.periods import DT, HOVER, LEVEL, PROFILE, period

RATES = (150.0, 400.0, 200.0)


def first(watch: Callable, periods: Callable[[int], object], n: int) -> tuple[int, str] | None:
    """The period in which a watch spoke, and what it said."""
    for k in range(n):
        said = watch(periods(k))
        if said is not None:
            return k, said
    return None


@pytest.mark.parametrize(("axis", "name"), [(0, "roll"), (1, "pitch"), (2, "yaw")])
def test_a_jump_of_an_encoder_is_seen_in_its_own_period(axis: int, name: str) -> None:
    def jumped(k: int):
        counts = [LEVEL, 0, 0]
        counts[axis] += -60 if k >= 40 else 0
        return period(k, counts=(counts[0], counts[1], counts[2]))

    found = first(Jump(PROFILE), jumped, 100)
    assert found is not None
    assert found[0] == 40
    assert f"the {name} encoder jumped by -60 counts within 2.0 ms" in found[1]


@given(
    rates=st.lists(st.tuples(*(st.floats(-1, 1) for _ in range(3))), min_size=5, max_size=60),
    gap=st.integers(1, 50),
)
def test_no_motion_within_the_envelope_is_a_jump(rates: list, gap: int) -> None:
    watch = Jump(PROFILE)
    angle = [0.0, 0.0, 0.0]
    q = PROFILE.encoder.rad_per_count * 180 / pi
    for n, rate in enumerate(rates):
        angle = [angle[i] + rate[i] * RATES[i] * DT * gap for i in range(3)]
        counts = tuple(round(a / q[i]) for i, a in enumerate(angle))
        assert watch(period(n * gap, counts=counts)) is None  # type: ignore[arg-type]


def test_a_jump_across_lost_samples_is_judged_by_the_time_that_went_by() -> None:
    watch = Jump(PROFILE)
    watch(period(0))
    assert watch(period(50, counts=(LEVEL + 100, 0, 0))) is None
    assert watch(period(51, counts=(LEVEL, 0, 0))) is not None


def swinging(k: int, volts: float, period_s: float = 2.0) -> float:
    return volts * (1 if (k * DT) % period_s < period_s / 2 else -1)


def test_a_roll_count_that_stands_still_under_a_changing_sum_is_frozen() -> None:
    def stuck(k: int):
        v = HOVER + swinging(k, 2.5)
        return period(k, counts=(LEVEL, k, k), v_applied=(v, v))

    found = first(Frozen(PROFILE), stuck, 2000)
    assert found is not None
    assert found[0] * DT < 1.6
    assert "the roll encoder is frozen: its count stood at 313" in found[1]
    assert "sum of the voltages changed by 10.0 V" in found[1]


def test_a_pitch_count_that_stands_still_under_a_changing_difference_is_frozen() -> None:
    def stuck(k: int):
        d = swinging(k, 4.5, 1.0)
        return period(k, counts=(LEVEL + k % 2, 7, k), v_applied=(HOVER + d / 2, HOVER - d / 2))

    found = first(Frozen(PROFILE), stuck, 2000)
    assert found is not None
    assert "pitch encoder is frozen: its count stood at 7" in found[1]


def test_a_yaw_count_that_stands_still_while_the_body_tips_to_and_fro_is_frozen() -> None:
    def stuck(k: int):
        pitch = round(swinging(k, 80))  # counts: 7 degrees
        return period(k, counts=(LEVEL + k % 2, pitch, 500))

    found = first(Frozen(PROFILE), stuck, 3000)
    assert found is not None
    assert "yaw encoder is frozen: its count stood at 500" in found[1]
    assert "pitch angle changed by 14°" in found[1]


def test_a_count_that_flickers_once_in_a_while_is_alive() -> None:
    def alive(k: int):
        v = HOVER + swinging(k, 2.5)
        return period(k, counts=(LEVEL + (k // 100) % 2, k, k), v_applied=(v, v))

    assert first(Frozen(PROFILE), alive, 5000) is None


def test_a_steady_drive_however_wrong_for_the_profile_is_no_sign() -> None:
    def lopsided(k: int):
        return period(k, v_applied=(2 * HOVER, 0.5 * HOVER))

    assert first(Frozen(PROFILE), lopsided, 5000) is None


def test_fast_shaking_that_no_count_can_follow_is_no_sign() -> None:
    def shaken(k: int):
        d = swinging(k, 6.0, 0.02)
        return period(k, v_applied=(HOVER + d, HOVER + d))

    assert first(Frozen(PROFILE), shaken, 5000) is None


def test_on_the_table_the_encoders_stand_still_by_right() -> None:
    def resting(k: int):
        v = max(0.0, swinging(k, 0.85 * HOVER))
        return period(k, counts=(0, 0, 0), v_applied=(v, v))

    assert first(Frozen(PROFILE), resting, 5000) is None


def test_on_the_table_a_sum_that_lifts_any_rig_and_moves_no_count_is_a_frozen_roll() -> None:
    def lifted(k: int):
        v = min(20.0, 0.1 * k)
        return period(k, counts=(0, 0, 0), v_applied=(v, v))

    found = first(Frozen(PROFILE), lifted, 500)
    assert found is not None
    assert found[0] * DT < 0.6
    assert "roll encoder is frozen" in found[1]
    assert "off the table" in found[1]
