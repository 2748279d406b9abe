"""Input of the peer tools: the flight in one piece, and columns that are torques."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.bench.peers import flights
from tests.bench.peers.interface import Task
from tests.bench.peers.pysindy_discrepancy import even, refits
from tests.bench.peers.pysindy_library import AXES, TIES, columns, known
from tests.hidden.sizes import EFFECTS
from tests.hidden.tools import longest

N = 400
TASK = Task(
    np.arange(N) * 0.002, np.full((N, 2), 7.0), np.zeros((N, 3)), flights.nominal(),
    flights.known(), np.full(3, 1e-3), np.ones(3),
)  # fmt: skip


def test_the_longest_stretch_of_rows_is_the_flight() -> None:
    assert longest(np.array([0, 1, 1, 0, 1, 1, 1, 0], dtype=bool)) == slice(4, 7)


def test_a_volt_on_both_motors_gives_a_roll_torque_and_none_on_pitch_and_yaw() -> None:
    roll, pitch, yaw = columns(np.zeros((N, 3)), np.zeros((N, 3)), np.ones((N, 2)), TASK)
    of = known(TASK)
    assert roll["base.gain"] == pytest.approx(2 * of["L_a"] * of["K_f"])
    assert pitch["base.gain"] == pytest.approx(0)
    assert yaw["base.gain"] == pytest.approx(0)


def test_the_lag_s_column_is_the_thrust_still_missing() -> None:
    V = np.ones((N, 2))
    V[:100] = 0
    lag = columns(np.zeros((N, 3)), np.zeros((N, 3)), V, TASK)[0]["motor.lag"]
    of = known(TASK)
    # 30 ms, its time constant, after the step e⁻¹ of it is missing.
    missing = -2 * of["L_a"] * of["K_f"] * np.exp(-1)
    assert lag[100 + 14] == pytest.approx(missing, rel=1e-6)


def test_every_column_and_its_confounded_effects_are_effects_that_can_be_hidden() -> None:
    library = columns(TASK.angle, np.zeros((N, 3)), TASK.voltage, TASK)
    names = {n for axis in library for n in axis if not n.startswith("base.")}
    assert names <= set(EFFECTS)
    assert set(TIES) <= names
    assert {n for tied in TIES.values() for n in tied} <= set(EFFECTS)
    assert len(library) == len(AXES)


def test_lost_samples_are_interpolated_and_the_voltage_is_held() -> None:
    t = TASK.t
    ramp = np.column_stack([t, 2 * t, -t])
    steps = np.column_stack([np.floor(t * 10), np.floor(t * 10)])
    keep = np.arange(N) % 7 != 3
    incomplete = replace(TASK, t=t[keep], angle=ramp[keep], voltage=steps[keep])
    whole = even(incomplete)
    assert np.allclose(np.diff(whole.t), 0.002)
    assert whole.angle == pytest.approx(ramp[: len(whole.t)])
    assert set(np.unique(whole.voltage)) <= set(np.unique(steps))


def test_the_base_is_refitted_together_with_the_found_terms() -> None:
    rng = np.random.default_rng(1)
    gain, effect = rng.normal(size=(2, 500))
    effect += gain  # correlated: without it the gain would be biased
    fits = refits(0.1 * gain + 2 * effect, {"base.gain": gain, "motor.lag": effect}, ["motor.lag"])
    assert [fit["base.gain"] for fit in fits] == pytest.approx([0.1] * len(fits))
