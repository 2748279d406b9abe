"""Free-form torque against named effects: gains by hand, with and without a catalogued cause."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.diagnosis.unmodelled.competition import (
    Contest,
    as_residual_torque,
    distance_from_absence,
    likelihood_gains,
    winning_torque,
)
from heli3dof.diagnosis.unmodelled.torque_evidence import Evidence, evidence
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import load_plan
from heli3dof.identification.greybox.method import fit_greybox


def evidence_of(hide: str, names: tuple[str, ...], seed: int) -> Evidence:
    device = f"mock:?speed=max&hide={hide}"
    recording = fly_plan(load_plan("rich"), device=device, seed=seed).recording.between(0.0, 40.0)
    return evidence(fit_greybox(recording, names), [recording], flights=8, seed=0)


def one_against_one(
    cross: float, u: float, d: float = 1.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """One named effect at distance d from absence and one function; information 100 each."""
    return likelihood_gains(
        np.array([[100.0]]), np.array([[cross]]), np.array([[100.0]]), np.array([[0.0]]),
        np.array([[u]]), np.array([d]), np.array([True]),
    )  # fmt: skip


def test_the_gain_of_a_cause_at_its_optimum_is_its_size_squared_over_its_variance() -> None:
    # g° = 100·1, so named = 100²/100; u° = 0 + 60·1, so free = 60²/100.
    free, named, both, rank = one_against_one(60.0, 0.0)
    assert (float(free[0]), float(named[0]), rank) == pytest.approx((36.0, 100.0, 1))
    # The function gains nothing in addition to the cause.
    assert both[0] == pytest.approx(100.0)


def test_a_free_form_and_a_cause_share_a_gain_if_they_are_correlated() -> None:
    # u = 40 with the cause fitted: efficient information 100 − 60²/100 = 64, so S = 40²/64 = 25.
    free, named, both, _ = one_against_one(60.0, 40.0)
    assert free[0] == pytest.approx((40 + 60) ** 2 / 100)
    assert both[0] == pytest.approx(100 + 25)
    # By hand: the joint step moves the cause by −60·40/6400 = −3/8, so Z'² = (5/8)²·64.
    assert (both - free)[0] == pytest.approx((5 / 8) ** 2 * 64)
    assert named[0] == pytest.approx(100.0)


def test_the_other_parameters_of_the_fit_are_projected_out() -> None:
    """A function that the other parameters can reproduce has rank 0 and no gain."""
    A = np.diag([100.0, 50.0])
    free, named, both, rank = likelihood_gains(
        A, np.array([[0.0], [50.0]]), np.array([[50.0]]), np.zeros((1, 2)), np.zeros((1, 1)),
        np.array([1.0, 0.0]), np.array([True, False]),
    )  # fmt: skip
    assert (rank, float(free[0]), float(named[0]), float(both[0])) == (0, 0.0, 0.0, 0.0)


WINNER = Contest(("x",), "yaw", "pitch", 600.0, 400.0, 610.0, 9, 1, 20_000, (-50.0, 10.0))


def test_a_free_form_pays_the_bic_price_of_its_parameters() -> None:
    # 600 − 400 − 8 ln 20000 = 120.8
    assert WINNER.bic_margin == pytest.approx(120.8, abs=0.05)
    assert WINNER.wins
    assert not replace(WINNER, free=470.0).wins


def test_a_free_form_does_not_win_if_null_simulations_give_the_same_gain() -> None:
    assert not replace(WINNER, nulls=(150.0, 10.0)).wins


def test_a_cause_that_keeps_its_gain_with_the_free_form_is_kept() -> None:
    """There is another effect, but it does not replace this cause."""
    assert not replace(WINNER, both=600.0 + 0.3 * 400.0).wins


def test_a_pitch_torque_from_the_voltage_product_is_not_reported_as_two_causes() -> None:
    both = ("motor.thrust_mismatch", "bias.torque.pitch")
    result = evidence_of("other.pitch_torque_from_voltage_product:0.0005", both, 1301)
    best = winning_torque(result, both)
    assert best is not None
    assert best.axis == "pitch"
    residual = as_residual_torque(result, best)
    assert residual.depends_on in ("voltage_product", "voltage_sum")
    assert residual.share > 0.3
    assert residual.confidence > 0.99
    # About hover k V_f V_b rises by k V_o for each volt of the sum: 0.0005 · 7.46 N·m/V.
    if residual.depends_on == "voltage_sum":
        z, torque = np.array(residual.table).T
        slope = np.polyfit(z, torque, 1, w=1 / np.array(residual.std))[0]
        assert slope == pytest.approx(0.0005 * 7.456, rel=0.25)


@pytest.mark.parametrize(
    ("hide", "names"),
    [
        ("motor.thrust_mismatch:1.1,bias.torque.pitch:-0.01",
         ("motor.thrust_mismatch", "bias.torque.pitch")),
        ("friction.coulomb.yaw:0.03", ("friction.coulomb.yaw",)),
    ],
)  # fmt: skip
def test_true_causes_win_against_every_free_form(hide: str, names: tuple[str, ...]) -> None:
    result = evidence_of(hide, names, 1302)
    # The distance from absence along the tangent is a linear term's value.
    free, values = result.fit.free[4], result.fit.values[4]
    assert distance_from_absence(result.fit)[4] == pytest.approx(
        (values - free.null) / free.slope(values)
    )
    assert winning_torque(result, names) is None
