"""Probabilities of changes against hand calculation, and their calibration by simulation."""

from __future__ import annotations

import doctest
from collections.abc import Iterator

import numpy as np
import pytest
from scipy.stats import invgamma

from heli3dof.fleet import change_posterior as change_posterior_module
from heli3dof.fleet.change_posterior import (
    KINDS,
    SINGLE,
    SIZES,
    UNLIKE,
    ChangePosterior,
    VariancePrior,
    candidate_changes,
    change_posterior,
    regressors,
)

PRIOR = {"step": 0.15, "two_steps": 0.1, "drift": 0.1, "deviating": 0.15}
RARE = {kind: 0.01 * probability for kind, probability in PRIOR.items()}


def test_probabilities_sum_to_one() -> None:
    found = change_posterior(np.arange(9.0) ** 2, np.ones(9), np.arange(9.0), PRIOR)
    assert found.constant + sum(map(found.kind, KINDS)) == pytest.approx(1.0)


def test_the_evidence_of_a_drift_by_numerical_integration() -> None:
    """Four flights with equal s: integrate over m, δ and φ on a grid, at each g."""
    y, t = np.array([0.0, 1.0, 1.5, 3.5]), np.arange(4.0)
    phi = np.exp(np.linspace(-4, 6, 500))
    expected, constant = 0.0, 0.0
    for g in SIZES:
        # y − mean has the covariance φ²(C + g² C x xᵀ C), C = 1 − 1/n; three contrasts describe it.
        contrast = np.linalg.svd(np.ones((1, 4)))[2][1:]
        for x, weight in ((t / 3, 1.0), (np.zeros(4), 0.0)):
            z, u = contrast @ y, contrast @ x
            cov = np.eye(3) + g**2 * np.outer(u, u)
            q, det = z @ np.linalg.solve(cov, z), np.linalg.det(cov)
            total = np.trapezoid(phi**-3.0 * np.exp(-q / phi**2 / 2) / np.sqrt(det), np.log(phi))
            if weight:
                expected += total / len(SIZES)
            else:
                constant = total
    found = change_posterior(y, np.ones(4), t, PRIOR)
    odds = found.kind("drift") / found.constant
    assert odds == pytest.approx(PRIOR["drift"] / 0.5 * expected / constant, rel=1e-4)


def test_the_evidence_with_the_siblings_scale_by_numerical_integration() -> None:
    """Four flights: φ² has a mixture of two scaled inverse χ² distributions as its prior."""
    y, t, scale = np.array([0.0, 1.0, 1.5, 3.5]), np.arange(4.0), VariancePrior(0.25, 7.0)
    phi = np.exp(np.linspace(-6, 8, 2000))
    contrast = np.linalg.svd(np.ones((1, 4)))[2][1:]
    z, u = contrast @ y, contrast @ (t / 3)

    def density(d: float) -> np.ndarray:
        """Of φ², times dφ²/d ln φ = 2φ²."""
        pdf = invgamma.pdf(phi**2, d / 2, scale=d * scale.variance / 2)
        return np.asarray(2 * phi**2 * pdf)

    prior = UNLIKE * density(1.0) + (1 - UNLIKE) * density(scale.freedom)
    evidence = []
    for cov in [np.eye(3), *(np.eye(3) + g**2 * np.outer(u, u) for g in SIZES)]:
        q, det = z @ np.linalg.solve(cov, z), np.linalg.det(cov)
        likelihood = phi**-3.0 * np.exp(-q / phi**2 / 2) / np.sqrt(det)
        evidence.append(np.trapezoid(prior * likelihood, np.log(phi)))
    expected = PRIOR["drift"] / (1 - sum(PRIOR.values())) * np.mean(evidence[1:]) / evidence[0]
    found = change_posterior(y, np.ones(4), t, PRIOR, None, scale)
    assert found.kind("drift") / found.constant == pytest.approx(expected, rel=1e-4)


def test_the_siblings_scale_makes_a_step_in_eight_flights_probable() -> None:
    y = np.array([0.3, -0.8, 0.5, 0.1, 6.2, 5.1, 6.9, 5.8])
    alone = change_posterior(y, np.ones(8), np.arange(8.0), RARE)
    known = change_posterior(y, np.ones(8), np.arange(8.0), RARE, None, VariancePrior(1, 90))
    assert known.constant < 0.05 < alone.constant
    assert (known.most_probable, known.best("step")) == ("step", 2)


def test_a_level_of_each_plan_has_no_influence() -> None:
    rng = np.random.default_rng(5)
    y, s, t = rng.normal(size=16), rng.uniform(0.5, 2, 16), np.arange(16.0)
    plans = np.array(["rich", "steps"] * 8)
    one = change_posterior(y, s, t, PRIOR, plans)
    other = change_posterior(y + 40 * (plans == "steps"), s, t, PRIOR, plans)
    for kind in KINDS:
        assert other.probability[kind] == pytest.approx(one.probability[kind], rel=1e-6)


def test_a_step_within_each_of_two_plans_is_found() -> None:
    plans = np.array(["rich", "steps"] * 8)
    step = 9.0 * (np.arange(16) >= 8)
    y = np.random.default_rng(6).normal(size=16) + 40 * (plans == "steps") + step
    found = change_posterior(y, np.ones(16), np.arange(16.0), PRIOR, plans)
    assert (found.most_probable, found.candidates["step"][found.best("step")]) == ("step", (8,))
    assert found.size["step"][found.best("step")] == pytest.approx(9, abs=2)


def test_a_change_of_plan_says_nothing_of_a_step_on_the_same_day() -> None:
    """Its probability relative to no change is that of the prior: 9 places."""
    plans = np.array(["rich"] * 6 + ["steps"] * 6)
    y = np.random.default_rng(7).normal(size=12) + 40 * (plans == "steps")
    found = change_posterior(y, np.ones(12), np.arange(12.0), PRIOR, plans)
    odds = found.probability["step"][4] / found.constant
    assert odds == pytest.approx(PRIOR["step"] / 9 / (1 - sum(PRIOR.values())))


def test_unit_zero_and_a_common_factor_of_the_deviations_do_not_matter() -> None:
    rng = np.random.default_rng(1)
    y, s, t = rng.normal(size=12), rng.uniform(0.5, 2, 12), np.sort(rng.uniform(size=12))
    one = change_posterior(y, s, t, PRIOR)
    other = change_posterior(60 * y + 7, 5 * s, 24 * t + 3, PRIOR)
    for kind in KINDS:
        assert other.probability[kind] == pytest.approx(one.probability[kind], rel=1e-6)
    for kind in SINGLE:
        assert other.size[kind] == pytest.approx(60 * one.size[kind], rel=1e-6)


def test_equal_values_did_not_change() -> None:
    assert change_posterior(np.full(9, 0.1), np.ones(9), np.arange(9.0), PRIOR).constant == 1.0


@pytest.mark.parametrize(
    ("kind", "y"),
    [
        ("step", [0.0] * 6 + [9.0] * 6),
        ("two_steps", [0.0] * 4 + [9.0] * 4 + [0.0] * 4),
        ("drift", np.linspace(0, 12, 12)),
        ("deviating", [0.0] * 5 + [9.0] + [0.0] * 6),
        ("deviating", [0.0] * 11 + [9.0]),
    ],
)
def test_each_kind_of_change_is_recognised(kind, y) -> None:
    """The median probability of the kind over 21 series is above 0.8.

    The strongest rival is a second small step in addition to the first. Of 28 pairs, 6 contain the
    true step before flight 6; of 9 steps one is the true one. With 2 and 4 flights on the new
    step's sides, Sxx = 2·4/6, and g = 16: the odds are (0.1·6/28)/(0.15/9)/√(1 + 16²·4/3) = 0.07.
    The best of 6 places fits chance by χ² of about 2, which makes them 0.07·e = 0.19, and
    1/1.19 = 0.84.
    """
    probabilities = []
    for seed in range(21):
        noise = 0.3 * np.random.default_rng(seed).normal(size=12)
        found = change_posterior(y + noise, np.ones(12), np.arange(12.0), PRIOR)
        probabilities.append(found.kind(kind))
    assert np.median(probabilities) > 0.8


Drawn = tuple[str, int, float, ChangePosterior]


def drawn_from_the_prior(n: int, many: int, seed: int) -> Iterator[Drawn]:
    """Yield kind, model, size and posterior of series of n flights with known truth.

    The truth is drawn from the priors, except that the share of the scatter is 0, ½ or 1.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(float(n))
    candidates = candidate_changes(n)
    steps = regressors("step", candidates, t)
    kinds = ["none", *KINDS]
    shares = [1 - sum(PRIOR.values()), *(PRIOR[k] for k in KINDS)]
    for _ in range(many):
        s, a = rng.uniform(0.3, 2.0, n), rng.choice([0.0, 0.5, 1.0])
        u = (1 - a) * (s / np.median(s)) ** 2 + a
        y, kind = rng.normal(0, np.sqrt(u)), str(rng.choice(kinds, p=shares))
        model, g = -1, rng.choice(SIZES)
        size = g * rng.normal()
        if kind != "none":
            model = int(rng.integers(len(candidates[kind])))
        if kind == "two_steps":
            j, k = candidates[kind][model]
            y = y + size * steps[j - 2] + g * rng.normal() * steps[k - 2]
        elif kind != "none":
            y = y + size * regressors(kind, candidates, t)[model]
        yield kind, model, size, change_posterior(y, s, t, PRIOR)


@pytest.fixture(
    scope="module", params=[8, *(pytest.param(n, marks=pytest.mark.accuracy) for n in (20, 60))]
)
def drawn(request) -> list[Drawn]:
    return list(drawn_from_the_prior(request.param, 1500, seed=request.param))


def share_true(stated: np.ndarray, true: np.ndarray, low: float, high: float) -> None:
    """Compare the share of true claims with their stated mean probability, ± 3 standard errors.

    0.03 are added because ``a`` is not drawn from its prior.
    """
    rows = (stated >= low) & (stated < high)
    p, n = stated[rows].mean(), rows.sum()
    assert n >= 20
    assert true[rows].mean() == pytest.approx(p, abs=3 * np.sqrt(p * (1 - p) / n) + 0.03)


@pytest.mark.parametrize(("low", "high"), [(0.1, 0.3), (0.3, 0.7), (0.7, 0.95), (0.95, 1.01)])
def test_stated_probabilities_of_a_change_are_right(drawn, low, high) -> None:
    stated = np.array([1 - posterior.constant for *_, posterior in drawn])
    share_true(stated, np.array([kind != "none" for kind, *_ in drawn]), low, high)


@pytest.mark.parametrize(("low", "high"), [(0.3, 0.7), (0.7, 0.95), (0.95, 1.01)])
def test_stated_probabilities_of_the_kind_are_right(drawn, low, high) -> None:
    named = [posterior.most_probable for *_, posterior in drawn]
    stated = np.array([d[3].kind(k) for d, k in zip(drawn, named, strict=True)])
    true = np.array([d[0] == k for d, k in zip(drawn, named, strict=True)])
    share_true(stated, true, low, high)


@pytest.mark.parametrize(("low", "high"), [(0.5, 0.9), (0.9, 1.01)])
def test_stated_probabilities_of_the_date_are_right(drawn, low, high) -> None:
    steps = [d for d in drawn if d[0] == "step" and d[3].most_probable == "step"]
    best = [posterior.best("step") for *_, posterior in steps]
    stated = np.array(
        [d[3].probability["step"][b] / d[3].kind("step") for d, b in zip(steps, best, strict=True)]
    )
    share_true(stated, np.array([d[1] == b for d, b in zip(steps, best, strict=True)]), low, high)


def test_intervals_of_the_size_hold_the_truth_in_95_of_100(drawn) -> None:
    single = [d for d in drawn if d[0] in SINGLE]
    clear = [d for d in single if d[3].probability[d[0]][d[1]] > 0.5]
    off = [(p.size[kind][m] - size) / p.size_std[kind][m] for kind, m, size, p in clear]
    error = 3 * np.sqrt(0.95 * 0.05 / len(off))
    assert np.mean(np.abs(off) < 1.96) == pytest.approx(0.95, abs=error + 0.01)


def test_the_doctests_pass() -> None:
    assert doctest.testmod(change_posterior_module).failed == 0
