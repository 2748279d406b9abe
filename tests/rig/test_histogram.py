"""Quantiles of the histogram are within 1 %."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from heli3dof.rig.histogram import RATIO, SHORTEST_S, Histogram

times = st.floats(SHORTEST_S, 80.0, exclude_min=True)


def filled(values: list[float]) -> Histogram:
    histogram = Histogram()
    for value in values:
        histogram.add(value)
    return histogram


def test_four_times_by_hand() -> None:
    histogram = filled([4e-6, 14e-6, 15e-6, 1.0])
    assert histogram.n == 4
    assert histogram.quantile_s(0.25) == pytest.approx(4e-6, rel=RATIO)
    assert histogram.quantile_s(0.5) == pytest.approx(14e-6, rel=RATIO)
    assert histogram.quantile_s(0.75) == pytest.approx(15e-6, rel=RATIO)
    assert histogram.quantile_s(1.0) == histogram.worst_s == 1.0


def test_an_empty_histogram_has_no_quantile() -> None:
    assert math.isnan(Histogram().quantile_s(0.5))


@given(st.lists(times, min_size=1, max_size=60), st.floats(0, 1))
def test_a_quantile_is_at_most_a_bin_too_long_and_never_too_short(
    values: list[float], share: float
) -> None:
    true = float(np.quantile(values, share, method="inverted_cdf"))
    result = filled(values).quantile_s(share)
    assert true * (1 - 1e-9) <= result <= true * (1 + RATIO) * (1 + 1e-9)


@given(st.lists(times, min_size=1))
def test_the_longest_time_is_exact(values: list[float]) -> None:
    histogram = filled(values)
    assert histogram.worst_s == max(values)
    assert histogram.quantile_s(1.0) <= max(values)


@pytest.mark.parametrize("time_s", [-1.0, 0.0, 1e-9, SHORTEST_S])
def test_times_below_a_clocks_resolution_are_reported_as_zero(time_s: float) -> None:
    histogram = filled([time_s])
    assert histogram.quantile_s(0.5) == 0.0
    assert histogram.n == 1


def test_times_beyond_the_last_bin_are_reported_as_the_longest() -> None:
    assert filled([100.0, 3600.0]).quantile_s(0.5) == 3600.0


def test_memory_does_not_grow_with_the_number_of_times() -> None:
    one, many = filled([1e-3]), Histogram()
    for k in range(1, 1_000_001):
        many.add(k * 1e-6)
    assert many.counts.buffer_info()[1] == one.counts.buffer_info()[1]
    assert many.quantile_s(0.5) == pytest.approx(0.5, rel=RATIO)
