"""An encoder that lived and is dead is found; whatever comes to rest by itself is not."""

from __future__ import annotations

from math import pi, sin
from pathlib import Path

import numpy as np
import pytest

from heli3dof.experiment.period import Period
from heli3dof.experiment.watches import Dead
from tests.experiment.watches.hovering import hover
from tests.experiment.watches.periods import DT, HOVER, LEVEL, PROFILE, period
from tests.paths import REAL_DATA, needs_real_data

LIVED_S = 40.0
PERIOD_S = 4.0


def breathing(t: float, counts: float = 3.0) -> int:
    return round(counts * sin(2 * pi * t / PERIOD_S))


def first(made, seconds: float) -> tuple[float, str] | None:
    """When the watch speaks up (s after `LIVED_S`), and what it says."""
    watch = Dead(PROFILE)
    for k in range(round((LIVED_S + seconds) / DT)):
        said = watch(made(k * DT, k))
        if said is not None:
            return k * DT - LIVED_S, said
    return None


def pitching(t: float, k: int, volts: float, count: int) -> Period:
    counts = (LEVEL + k % 2, count, k // 100)
    return period(k, counts=counts, v_applied=(HOVER + volts / 2, HOVER - volts / 2))


def test_what_turned_an_axis_and_turns_it_no_more_is_told_by_four_times_the_drive() -> None:
    def dies(t: float, k: int) -> Period:
        alive = t < LIVED_S
        volts = (0.1 if alive else 0.8) * sin(2 * pi * t / PERIOD_S)
        return pitching(t, k, volts, breathing(t) if alive else 0)

    found = first(dies, 20)
    assert found is not None
    assert 0.3 < found[0] < 2.0
    assert "the pitch encoder is frozen: its count stood at 0" in found[1]
    assert "times what turned it before" in found[1]


def test_twice_the_drive_may_be_lost_in_play() -> None:
    def lost(t: float, k: int) -> Period:
        alive = t < LIVED_S
        volts = (0.1 if alive else 0.2) * sin(2 * pi * t / PERIOD_S)
        return pitching(t, k, volts, breathing(t) if alive else 0)

    assert first(lost, 5) is None


def test_a_drive_that_turned_it_before_is_no_evidence() -> None:
    def held(t: float, k: int) -> Period:
        alive = t < LIVED_S
        return pitching(t, k, 2.0 * sin(2 * pi * t / PERIOD_S), breathing(t) if alive else 0)

    assert first(held, 30) is None


def test_an_axis_that_needed_little_and_stands_still_for_long_is_frozen() -> None:
    def dies(t: float, k: int) -> Period:
        alive = t < LIVED_S
        volts = 0.1 * sin(2 * pi * t / PERIOD_S) if alive else 0.0
        return pitching(t, k, volts, breathing(t) if alive else 0)

    found = first(dies, 30)
    assert found is not None
    assert 5.5 < found[0] < 12.0
    assert "never still for longer than" in found[1]


def test_swings_that_die_away_end_in_a_rest_that_is_nothings_fault() -> None:
    def decays(t: float, k: int) -> Period:
        counts = 60.0 * 0.995 ** (100 * t / PERIOD_S)
        volts = 0.02 * counts * sin(2 * pi * t / PERIOD_S)
        return pitching(t, k, volts, breathing(t, counts))

    assert first(decays, 60) is None


def test_an_edge_that_chatters_by_one_count_is_no_life() -> None:
    def chatters(t: float, k: int) -> Period:
        alive = t < LIVED_S
        volts = 0.1 * sin(2 * pi * t / PERIOD_S)
        return pitching(t, k, volts, int(t * 10) % 2 if alive else 0)

    assert first(chatters, 60) is None


def test_on_the_table_nothing_is_known() -> None:
    def lands(t: float, k: int) -> Period:
        alive = t < LIVED_S
        volts = 0.1 * sin(2 * pi * t / PERIOD_S)
        counts = (LEVEL if alive else 0, breathing(t) if alive else 0, 0)
        return period(k, counts=counts, v_applied=(HOVER + volts / 2, HOVER - volts / 2))

    assert first(lands, 60) is None


@pytest.mark.parametrize(("axis", "within_s"), [("pitch", 10.0), ("yaw", 25.0)])
def test_an_encoder_that_freezes_in_a_calm_hover_is_found(axis: str, within_s: float) -> None:
    outcome = hover(60.0 + within_s, 1, f"&fault=frozen.{axis}@60")
    assert outcome.ending == "tripped"
    assert f"the {axis} encoder is frozen" in outcome.detail
    assert outcome.periods * DT > 60.0


REAL = sorted(REAL_DATA.glob("rig-*/closed-*.csv"))


@needs_real_data
@pytest.mark.parametrize("path", REAL, ids=lambda path: path.stem)
def test_a_real_flight_is_flown_to_its_end(path: Path) -> None:
    log = np.genfromtxt(path, delimiter=",", names=True)
    rate_hz = 1 / np.median(np.diff(log["t_s"]))
    loop = PROFILE.loop.model_copy(update={"rate_hz": round(rate_hz)})
    watch = Dead(PROFILE.model_copy(update={"loop": loop}))
    rest, q = PROFILE.encoder.rest_rad, PROFILE.encoder.rad_per_count
    angles = np.radians(np.column_stack([log[f"{axis}_deg"] for axis in ("roll", "pitch", "yaw")]))
    counts = np.rint((angles - rest) / q).astype(int)
    volts = zip(log["v_front_V"], log["v_back_V"], strict=True)
    for k, (at, v) in enumerate(zip(counts.tolist(), volts, strict=True)):
        assert watch(period(k, counts=tuple(at), v_applied=v)) is None, k / rate_hz


def test_a_calm_hover_is_flown_to_its_end() -> None:
    assert hover(100.0, 2).ending == "completed"
