"""Slow noise increases the scatter of parameters; the recording shows by how much."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import pytest

from heli3dof.identification.bias_correction.coloured_noise import (
    freedom,
    long_run,
    significant_ratio,
)
from heli3dof.identification.bias_correction.correction import CorrectedFit, model_at
from heli3dof.identification.bias_correction.simulated_flight import simulated_flight
from heli3dof.identification.closed_loop_fit.base_fit import fit_base
from heli3dof.identification.closed_loop_fit.setup import Setup
from heli3dof.recording.recording import Recording
from tests.flown import flown

DEVICE = "mock:?speed=max&start=level&spread=0.07&seed=1411"
TIMES = 15.0
MEMORY_S = 0.5


class Slow:
    """Random generator of white noise plus an Ornstein-Uhlenbeck process (`MEMORY_S`), which has
    `TIMES` the power at low frequency."""

    def __init__(self, seed: int, dt: float) -> None:
        self.rng, self.dt = np.random.default_rng(seed), dt

    def uniform(self, *a: Any) -> Any:
        return self.rng.uniform(*a)

    def standard_normal(self, shape: tuple[int, int]) -> np.ndarray:
        from scipy.signal import lfilter

        phi = np.exp(-self.dt / MEMORY_S)
        # At frequency zero: σ² (1 + φ)/(1 − φ) = TIMES
        sigma = np.sqrt(TIMES * (1 - phi) / (1 + phi))
        drive = self.rng.standard_normal(shape) * sigma * np.sqrt(1 - phi**2)
        slow = lfilter([1.0], [1.0, -phi], drive, axis=0)
        return np.asarray(self.rng.standard_normal(shape) + slow)


def test_correlation_between_blocks_adds_to_the_covariance_of_the_sum() -> None:
    # 1, 2, −1, −2 about its mean 0: Γ_0 = 10, Γ_1 = 2 − 2 + 2 = 2; with weight 1/2 both ways 12.
    scores = np.array([[1.0], [2.0], [-1.0], [-2.0]])
    assert long_run(scores, 0)[0, 0] == pytest.approx(10.0)
    assert long_run(scores, 1)[0, 0] == pytest.approx(12.0)


def test_a_constant_mean_is_not_colour() -> None:
    scores = np.array([[1.0], [2.0], [-1.0], [-2.0]])
    np.testing.assert_allclose(long_run(scores + 7.0, 1), long_run(scores, 1))


def test_the_long_run_variance_of_an_autoregression_matches_its_formula() -> None:
    rng = np.random.default_rng(1412)
    phi, m = 0.5, 40_000
    x = np.zeros(m)
    for k in range(1, m):
        x[k] = phi * x[k - 1] + rng.standard_normal()
    # Long-run variance 1/(1 − φ)² per row; Bartlett weights over 60 rows omit little.
    assert long_run(x[:, None], 60)[0, 0] / m == pytest.approx(4.0, rel=0.12)


def test_only_significant_ratios_count_as_colour() -> None:
    # 120 blocks, memory of 6: ν = 180/7; white noise exceeds 1.76 in one flight of a hundred.
    nu = freedom(120, 6)
    assert nu == pytest.approx(25.7, abs=0.05)
    np.testing.assert_allclose(significant_ratio(np.array([0.3, 1.5, 1.9]), nu), [1.0, 1.0, 1.9])


@pytest.fixture(scope="module")
def white() -> tuple[Recording, CorrectedFit]:
    flight = flown("steps", 48.0, device=DEVICE, seed=1411).between(8.0, 48.0)
    return flight, fit_base(Setup((flight,), seed=0, flights_per_round=6))


@pytest.mark.accuracy
def test_a_flight_with_white_noise_has_no_colour(white: tuple[Recording, CorrectedFit]) -> None:
    np.testing.assert_array_equal(white[1].coloured_noise_factor, np.ones(4))


@pytest.mark.accuracy
def test_a_flight_with_slow_noise_has_wider_intervals(
    white: tuple[Recording, CorrectedFit],
) -> None:
    recording, result = white
    model = model_at(result.problem, result.optimum.theta, result.optimum.noise)
    slow = simulated_flight(model, recording, cast(Any, Slow(1413, recording.dt)))
    fit = fit_base(Setup((slow,), seed=0, flights_per_round=6))
    assert fit.coloured_noise_factor[0] > 2.0  # the trim torque, the slowest parameter
    # The standard deviation for white noise of the estimated intensity, times √ρ.
    spread = fit.covariance_with_edge_rates  # of a fit with edge rates
    if spread is None:
        assert fit.is_corrected
        L = np.diag(fit.problem.prior_precision)
        inverse = np.linalg.inv(fit.optimum.information + L)
        spread = inverse @ ((1 + 1 / fit.flights) * fit.score_covariance + L) @ inverse
    plain = np.sqrt(spread[0, 0]) * fit.slopes[0]
    assert fit.std[0] == pytest.approx(np.sqrt(fit.coloured_noise_factor[0]) * plain)
