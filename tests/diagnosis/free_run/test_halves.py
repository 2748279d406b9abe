"""Estimates in both halves of the recordings: the rules, on synthetic values."""

from __future__ import annotations

import pytest

from heli3dof.diagnosis.free_run.halves import (
    HalvesComparison,
    compare_halves,
    equivalent_deviation,
)


def test_both_halves_must_have_the_same_sign() -> None:
    assert HalvesComparison((3.0, 2.0), 0.5, False).significant_in_both
    assert not HalvesComparison((3.0, -2.0), 4.0, False).significant_in_both


def test_one_half_without_significance_is_not_enough() -> None:
    assert not HalvesComparison((9.0, 1.0), 0.5, False).significant_in_both


def test_an_estimate_from_the_prior_alone_does_not_count() -> None:
    assert not HalvesComparison((5.0, 5.0), 0.0, True).significant_in_both


def test_sizes_that_differ_by_more_than_three_deviations_are_inconsistent() -> None:
    assert HalvesComparison((9.0, 5.0), 2.9, False).one_size
    assert not HalvesComparison((9.0, 5.0), 3.1, False).one_size


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
