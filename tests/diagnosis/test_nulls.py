"""The nulls' arithmetic: thresholds keep their promise on numbers drawn by the rule they assume."""

from __future__ import annotations

import numpy as np
import pytest

from heli3dof.diagnosis.nulls import judged_by

PROBES = 45


def largest(rng: np.random.Generator, flights: int, sigma: np.ndarray) -> tuple[float, float]:
    """(the recording's largest Z², the threshold) where the recording is one more null."""
    z = rng.standard_normal((flights + 1, PROBES)) * sigma + 3.0
    nulls = judged_by(z[:-1])
    return float((((z[-1] - nulls.mean) / nulls.std) ** 2).max()), nulls.threshold


@pytest.mark.parametrize("flights", [16, 48])
def test_one_more_null_is_hardly_ever_taken_for_a_finding(flights: int) -> None:
    rng = np.random.default_rng(1000)
    sigma = np.full(PROBES, 1.3)
    alarms = sum(z > t for z, t in (largest(rng, flights, sigma) for _ in range(1000)))
    assert alarms <= 10


def test_the_threshold_is_that_of_few_flights() -> None:
    rng = np.random.default_rng(1001)
    few, many = (judged_by(rng.standard_normal((n, PROBES))) for n in (12, 200))
    assert few.threshold > many.threshold > 15


def test_what_every_null_shows_is_no_finding() -> None:
    rng = np.random.default_rng(1002)
    z = rng.standard_normal((16, PROBES))
    z[:, 7] += 80.0
    nulls = judged_by(z)
    assert abs(nulls.mean[7] - 80) < 1
    assert nulls.confidence(4.0) < 0.5
    assert nulls.confidence(100.0) > 0.99
