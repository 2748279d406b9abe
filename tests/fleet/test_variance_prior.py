"""What sibling rigs say of a rig's scatter, against simulated rigs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.fleet.tracks import Track
from heli3dof.fleet.variance_prior import LEAST_SIBLINGS, variance_prior
from tests.fleet.calibration import room, track_of


def test_siblings_that_scatter_alike_say_much() -> None:
    """Scatter of 2; d is then the sum of f_r = 2·49²/146 = 32.9 over 20 siblings."""
    found = variance_prior(room(np.random.default_rng(1), 50, scatter=2.0))
    assert found is not None
    assert found.variance == pytest.approx(4.0, rel=0.15)
    assert found.freedom > 100


def test_siblings_that_scatter_differently_say_little() -> None:
    """ln φ² has the variance (2·0.5)² = 1 = ψ'(d/2), so d = 2.85."""
    freedom = [
        found.freedom
        for seed in range(20)
        if (found := variance_prior(room(np.random.default_rng(seed), 50, spread=0.5)))
    ]
    assert np.median(freedom) == pytest.approx(2.85, rel=0.3)


def test_steps_of_a_quarter_of_the_siblings_have_little_influence() -> None:
    tracks = room(np.random.default_rng(2), 20)
    before = variance_prior(tracks)
    step = 10.0 * (np.arange(20) >= 9)
    stepped = [replace(t, y=t.y + step) for t in tracks[:5]] + tracks[5:]
    after = variance_prior(stepped)
    assert before is not None
    assert after is not None
    assert 0.8 < after.variance / before.variance < 1.5
    assert after.freedom > 5


def test_a_change_of_plan_is_no_scatter() -> None:
    tracks = room(np.random.default_rng(3), 20)
    plans = np.array(["rich"] * 10 + ["steps"] * 10)
    same = [replace(t, plans=plans) for t in tracks]
    moved = [replace(t, plans=plans, y=t.y + 50 * (plans == "steps")) for t in tracks]
    one, other = variance_prior(same), variance_prior(moved)
    assert one is not None
    assert other is not None
    assert other.variance == pytest.approx(one.variance)


@pytest.mark.parametrize(
    "tracks",
    [
        room(np.random.default_rng(4), 20, rigs=LEAST_SIBLINGS - 1),
        room(np.random.default_rng(4), 4),
        [track_of(np.zeros(20))] * 20,
    ],
    ids=["four siblings", "four flights each", "equal values"],
)
def test_too_little_says_nothing(tracks: list[Track]) -> None:
    assert variance_prior(tracks) is None
