"""Random-effects estimates against hand calculation, published numbers and simulation."""

from __future__ import annotations

from math import sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from heli3dof.fleet.random_effects import random_effects, scatter_variance, shrunken

# Trials of the BCG vaccine (Colditz et al., JAMA 271, 1994): infected and not infected, of the
# vaccinated and of the controls.
BCG = np.array([
    [4, 119, 11, 128], [6, 300, 29, 274], [3, 228, 11, 209], [62, 13536, 248, 12619],
    [33, 5036, 47, 5761], [180, 1361, 372, 1079], [8, 2537, 10, 619], [505, 87886, 499, 87892],
    [29, 7470, 45, 7232], [17, 1699, 65, 1600], [186, 50448, 141, 27197], [5, 2493, 3, 2338],
    [27, 16886, 29, 17825],
])  # fmt: skip


def test_the_paule_mandel_variance_of_the_bcg_trials() -> None:
    """Log risk ratios. Reference: statsmodels 0.14, `combine_effects(method_re="iterated")`."""
    a, b, c, d = BCG.T
    y = np.log(a / (a + b)) - np.log(c / (c + d))
    s = np.sqrt(1 / a - 1 / (a + b) + 1 / c - 1 / (c + d))
    found = random_effects(y, s)
    assert found.scatter**2 == pytest.approx(0.31806845220502, rel=1e-9)
    assert found.value == pytest.approx(-0.71496815349344, rel=1e-9)
    assert found.std == pytest.approx(0.18089219153762, rel=1e-9)  # Hartung and Knapp
    assert found.scatter**2 == pytest.approx(bisected(y.tolist(), s.tolist()), rel=1e-9)


def bisected(y: list[float], s: list[float]) -> float:
    """τ² with Σw(y − θ̂)² = n − 1, by bisection between 0 and 10."""
    low, high = 0.0, 10.0
    for _ in range(60):
        middle = (low + high) / 2
        w = [1 / (e * e + middle) for e in s]
        mean = sum(wi * yi for wi, yi in zip(w, y, strict=True)) / sum(w)
        q = sum(wi * (yi - mean) ** 2 for wi, yi in zip(w, y, strict=True))
        low, high = (middle, high) if q > len(y) - 1 else (low, middle)
    return low


@given(st.floats(1e-6, 1e6), st.integers(2, 50))
def test_equal_measurements_give_exactly_their_value(y: float, n: int) -> None:
    found = random_effects(np.full(n, y), np.full(n, 0.3 * y))
    assert (found.value, found.std, found.scatter) == (y, 0.0, 0.0)


def test_two_measurements_by_hand() -> None:
    """y = 0 and 4 with s = 1: the mean 2, its standard error √(8/2) = 2, and τ² = 8 − 1."""
    found = random_effects(np.array([0.0, 4.0]), np.ones(2))
    assert (found.value, found.std) == (pytest.approx(2.0), pytest.approx(2.0))
    assert found.scatter**2 == pytest.approx(7.0)
    own, std = shrunken(np.array([0.0, 4.0]), np.ones(2), found)
    assert own == pytest.approx([0.25, 3.75])  # B = 7/8
    assert std == pytest.approx(sqrt(7 / 8 + 4 / 64))


values = st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=30).map(np.array)


@given(values, st.floats(0.01, 1e4))
def test_equal_deviations_give_the_mean_and_its_standard_error(y, s) -> None:
    found = random_effects(y, np.full(len(y), s))
    assert found.value == pytest.approx(y.mean(), abs=1e-9)
    assert found.std == pytest.approx(y.std(ddof=1) / sqrt(len(y)), rel=1e-6, abs=1e-9)


@given(values, st.floats(1e-3, 1e3), st.floats(-100, 100))
def test_the_unit_of_a_quantity_does_not_matter(y, unit, zero) -> None:
    s = np.linspace(0.5, 2.0, len(y))
    before, after = random_effects(y, s), random_effects(unit * y + zero, unit * s)
    assert after.value == pytest.approx(unit * before.value + zero, rel=1e-5, abs=1e-5 * unit)
    assert after.scatter == pytest.approx(unit * before.scatter, rel=1e-4, abs=1e-4 * unit)


def test_the_scatter_makes_the_weighted_sum_of_squares_equal_to_its_expectation() -> None:
    y, s = np.array([1.0, 3.0, -2.0, 8.0]), np.array([0.5, 1.0, 0.1, 2.0])
    w = 1 / (s**2 + scatter_variance(y, s))
    assert w @ (y - w @ y / w.sum()) ** 2 == pytest.approx(3.0)


def test_equal_values_have_no_scatter() -> None:
    found = random_effects(np.zeros(5), np.zeros(5))
    assert (found.value, found.std, found.scatter) == (0.0, 0.0, 0.0)


def test_one_measurement_has_its_own_deviation_and_no_interval() -> None:
    found = random_effects(np.array([2.0]), np.array([0.5]))
    assert (found.value, found.std) == (2.0, 0.5)
    assert np.isnan(found.interval).all()


@pytest.mark.parametrize("flights", [3, 5, 20])
@pytest.mark.parametrize("scatter", [0.0, 1.0])
@pytest.mark.parametrize("wrong_by", [0.3, 1.0, 3.0])
def test_intervals_hold_the_truth_in_95_of_100_series(flights, scatter, wrong_by) -> None:
    """``wrong_by``: the stated standard deviations divided by the true ones.

    Bounds: 95 % ± 3 standard errors of 600 series (2.7 %), and 2 % for unequal deviations.
    """
    rng = np.random.default_rng(flights)
    inside = 0
    for _ in range(600):
        s = rng.uniform(0.5, 1.5, flights)
        y = rng.normal(0.0, np.hypot(s, scatter))
        low, high = random_effects(y, wrong_by * s).interval
        inside += low <= 0 <= high
    assert 0.903 <= inside / 600 <= 0.997


def test_tiny_standard_deviations_leave_the_variance_of_the_measurements() -> None:
    y = np.array([0.0, 1.0, 2.0, 5.0]) * 1e-15
    for scale in (1e-30, 1e-25, 1e-24):
        assert scatter_variance(y, np.full(4, scale)) == pytest.approx(np.var(y, ddof=1))
