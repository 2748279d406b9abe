"""Terms that both halves of the recordings show: the rules, on values made by hand."""

from __future__ import annotations

import pytest

from heli3dof.diagnosis.free_run.halves import Seen, rarity, seen


def test_both_halves_must_have_the_same_sign() -> None:
    assert Seen((3.0, 2.0), 0.5, False).by_both
    assert not Seen((3.0, -2.0), 4.0, False).by_both


def test_one_weak_half_is_enough_to_doubt() -> None:
    assert not Seen((9.0, 1.0), 0.5, False).by_both


def test_an_estimate_from_the_prior_alone_does_not_count() -> None:
    assert not Seen((5.0, 5.0), 0.0, True).by_both


def test_sizes_three_deviations_apart_differ() -> None:
    assert Seen((9.0, 5.0), 2.9, False).one_size
    assert not Seen((9.0, 5.0), 3.1, False).one_size


@pytest.mark.parametrize(
    ("chi2", "freedom", "deviations"), [(4.0, 1, 2.0), (0.0, 1, 0.0), (5.991, 2, 1.960)]
)
def test_a_chi_square_converts_to_equally_rare_deviations(
    chi2: float, freedom: int, deviations: float
) -> None:
    """χ² of one number is its square; 5 % lie above 5.991 with two."""
    assert rarity(chi2, freedom) == pytest.approx(deviations, abs=1e-3)


def test_a_single_fit_has_no_halves() -> None:
    assert seen((), "friction.coulomb.yaw") is None
