"""Estimates in both halves of the recordings: the rules, on synthetic values."""

from __future__ import annotations

import pytest

from heli3dof.diagnosis.free_run.halves import (
    NullDistance,
    compare_halves,
    compared,
    equivalent_deviation,
)


def significant(u: float, other: float, mostly_prior: bool = False) -> bool:
    """Whether two estimates that are u and ``other`` standard deviations from zero both count."""
    return compared(NullDistance(u, u, 1.0, mostly_prior), NullDistance(other, other, 1.0))[1]


def test_both_halves_must_have_the_same_sign() -> None:
    assert significant(3.0, 2.0)
    assert not significant(3.0, -2.0)


def test_one_half_without_significance_is_not_enough() -> None:
    assert not significant(9.0, 1.0)


def test_an_estimate_from_the_prior_alone_does_not_count() -> None:
    assert not significant(5.0, 5.0, mostly_prior=True)


def test_sizes_that_differ_by_more_than_three_deviations_are_inconsistent() -> None:
    one = NullDistance(9.0, 9.0, 1.0)
    assert compared(one, NullDistance(5.0, 9.0 - 2.9 * 2**0.5, 1.0))[0]
    assert not compared(one, NullDistance(5.0, 9.0 - 3.1 * 2**0.5, 1.0))[0]


@pytest.mark.parametrize(
    ("chi2", "freedom", "deviations"), [(4.0, 1, 2.0), (0.0, 1, 0.0), (5.991, 2, 1.960)]
)
def test_a_chi_square_converts_to_equally_rare_deviations(
    chi2: float, freedom: int, deviations: float
) -> None:
    """χ² of one number is its square; for two numbers, 5 % lie above 5.991."""
    assert equivalent_deviation(chi2, freedom) == pytest.approx(deviations, abs=1e-3)


def test_a_single_fit_has_no_halves() -> None:
    assert compare_halves((), "friction.coulomb.yaw") is None
