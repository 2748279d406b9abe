from __future__ import annotations

import numpy as np
import pytest

from heli3dof.identification.residual_tests import past_inputs, whiteness


def white(n: int, seed: int, columns: int = 3) -> np.ndarray:
    mix = np.random.default_rng(99).standard_normal((columns, columns)) + 2 * np.eye(columns)
    return np.random.default_rng(seed).standard_normal((n, columns)) @ mix


def test_white_innovations_pass_at_the_nominal_rate() -> None:
    """99 % bound, 100 records, seeds 0–99."""
    passed = [whiteness([white(800, s)]).passed for s in range(100)]
    assert 95 <= sum(passed) <= 100


def test_coloured_innovations_fail() -> None:
    e = white(800, 0)
    e[1:] += 0.3 * e[:-1]
    result = whiteness([e])
    assert not result.passed
    # a moving average 1 + 0.3 q⁻¹: the past explains 1 − 1/(1 + 0.3²) = 8.3 %
    assert result.share == pytest.approx(0.083, abs=0.03)


def test_one_lag_s_statistic_is_the_hand_computed_one() -> None:
    # e = 1, −1, 1, −1, …: R_0 = 1, R_1 = −(N−1)/N, so Q = N² ((N−1)/N)² / (N−1) = N − 1
    e = np.resize([1.0, -1.0], 100)[:, None]
    assert whiteness([e], h=1).statistic == pytest.approx(99.0)


def test_coloured_past_inputs_pass_at_the_nominal_rate() -> None:
    passed = []
    for s in range(100):
        u = white(800, 1000 + s, 2)
        for k in range(1, 800):
            u[k] += 0.9 * u[k - 1]
        passed.append(past_inputs([white(800, s)], [u]).passed)
    assert 95 <= sum(passed) <= 100


def test_an_input_missing_from_the_model_fails() -> None:
    u, e = white(800, 1, 2), white(800, 2)
    e[3:, 1] += 0.5 * u[:-3, 0]
    assert not past_inputs([e], [u]).passed


def test_an_input_that_responds_to_innovations_passes() -> None:
    e = white(800, 3)
    u = -e[:, :2] + 0.1 * white(800, 4, 2)
    assert past_inputs([e], [u]).passed


def test_the_sentence_names_verdict_and_bound() -> None:
    assert whiteness([white(400, 5)]).sentence().startswith("whiteness: passed (χ²(180)")
