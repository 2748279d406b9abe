"""Thresholds from nulls keep their false-alarm rate if the scores are normally distributed."""

from __future__ import annotations

import doctest

import numpy as np
import pytest

from heli3dof.diagnosis.search import nulls as module
from heli3dof.diagnosis.search.nulls import nulls_from_scores

PROBES = 45


def largest(rng: np.random.Generator, flights: int, sigma: np.ndarray) -> tuple[float, float]:
    """(the recording's largest Z², the threshold) where the recording is one more null."""
    z = rng.standard_normal((flights + 1, PROBES)) * sigma
    nulls = nulls_from_scores(z[:-1])
    return float((((z[-1] - nulls.mean) / nulls.std) ** 2).max()), nulls.threshold


def test_the_doctests_pass() -> None:
    assert doctest.testmod(module).failed == 0


@pytest.mark.parametrize("flights", [16, 48])
def test_one_more_null_rarely_exceeds_the_threshold(flights: int) -> None:
    rng = np.random.default_rng(1000)
    sigma = np.full(PROBES, 1.3)
    alarms = sum(z > t for z, t in (largest(rng, flights, sigma) for _ in range(1000)))
    assert alarms <= 10


def test_the_threshold_is_higher_for_few_flights() -> None:
    rng = np.random.default_rng(1001)
    few, many = (nulls_from_scores(rng.standard_normal((n, PROBES))) for n in (12, 200))
    assert few.threshold > many.threshold > 15


def test_a_bias_widens_the_standard_deviation_of_its_probe_only() -> None:
    rng = np.random.default_rng(1002)
    z = rng.standard_normal((16, PROBES))
    z[:, 7] += 80.0
    nulls = nulls_from_scores(z)
    assert abs(nulls.mean[7] - 80) < 1
    assert nulls.std[7] > 19 > 2 > nulls.std[6]
    assert nulls.confidence(4.0) < 0.5
    assert nulls.confidence(100.0) > 0.99
