"""Rigs that differ from their siblings."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import t

from heli3dof.fleet.random_effects import Estimate, random_effects
from heli3dof.fleet.siblings import differing_rigs, fleet_estimate


def rigs(values: np.ndarray, flights: int, seed: int) -> dict[str, Estimate]:
    """Each rig's estimate from flights with standard deviation 1."""
    rng = np.random.default_rng(seed)
    return {
        f"rig-{i:02d}": random_effects(rng.normal(v, 1, flights), np.ones(flights))
        for i, v in enumerate(values)
    }


def test_the_p_value_by_hand() -> None:
    """Siblings 0 and 2 without error: mean 1, ω² = 2, v_μ² = 1; the rig is 30 ± 0 above."""
    three = {name: Estimate(9, value, 1e-9, 0.0) for name, value in (("a", 0), ("b", 2), ("c", 31))}
    (found,) = differing_rigs({**three, "c": Estimate(9, 1e6, 1e-9, 0.0)}, 1)
    assert found.rig == "c"
    assert found.size == pytest.approx(1e6 - 1)
    assert found.p_value == pytest.approx(3 * 2 * t.sf(found.size / np.sqrt(3), 1), rel=1e-3)
    assert differing_rigs(three, 1) == ()  # 30/√3 with one degree of freedom: p = 3 · 0.037


def test_like_rigs_are_named_in_at_most_5_of_100_fleets() -> None:
    """Bound: 5 % + 3 standard errors of 200 fleets."""
    named = 0
    for seed in range(200):
        spread = np.random.default_rng(1000 + seed).normal(0, 0.5, 20)
        named += bool(differing_rigs(rigs(spread, 5, seed), 1))
    assert named / 200 <= 0.05 + 3 * np.sqrt(0.05 * 0.95 / 200)


def test_two_differing_rigs_do_not_hide_each_other() -> None:
    values = np.random.default_rng(1).normal(0, 0.5, 20)
    values[[3, 7]] = 12.0
    found = differing_rigs(rigs(values, 20, 2), 30)
    assert {d.rig for d in found} == {"rig-03", "rig-07"}


def test_one_flight_has_the_scatter_of_the_siblings_in_its_error() -> None:
    """Siblings scatter by 10 from flight to flight, so 20 off by one flight is not unusual."""
    rng = np.random.default_rng(3)
    fleet = {f"rig-{i}": random_effects(rng.normal(0, 10, 50), np.full(50, 0.1)) for i in range(10)}
    fleet["new"] = random_effects(np.array([20.0]), np.array([0.1]))
    assert differing_rigs(fleet, 1) == ()


def test_rigs_that_lose_no_sample_are_alike() -> None:
    none = random_effects(np.zeros(10), np.zeros(10))
    assert differing_rigs(dict.fromkeys("abcdef", none), 1) == ()


def test_two_rigs_have_no_scatter_to_compare_with() -> None:
    assert differing_rigs(rigs(np.array([0.0, 50.0]), 9, 1), 1) == ()


def test_the_fleets_mean_weighs_rigs_alike_if_they_differ_much() -> None:
    found = fleet_estimate(rigs(np.array([0.0, 100.0, 200.0]), 50, 4))
    assert found is not None
    assert found.value == pytest.approx(100, abs=0.5)
    assert found.scatter == pytest.approx(100, abs=1)
