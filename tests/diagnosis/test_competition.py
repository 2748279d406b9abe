"""One free form against names: what each wins by hand, a torque outside the catalogue, a cause."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.diagnosis.competition import Rival, as_leftover, away, rival, won
from heli3dof.diagnosis.leftover_evidence import Evidence, evidence
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import load_plan
from heli3dof.identification.greybox.method import fit_greybox


def seen(hide: str, names: tuple[str, ...], seed: int) -> Evidence:
    device = f"mock:?speed=max&hide={hide}"
    recording = fly_plan(load_plan("rich"), device=device, seed=seed).recording.between(0.0, 40.0)
    return evidence(fit_greybox(recording, names), [recording], flights=8, seed=0)


def one_against_one(
    cross: float, u: float, d: float = 1.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """A name at d from absent beside nothing else, and one function; informations 100 each."""
    return won(
        np.array([[100.0]]), np.array([[cross]]), np.array([[100.0]]), np.array([[0.0]]),
        np.array([[u]]), np.array([d]), np.array([True]),
    )  # fmt: skip


def test_a_name_at_its_best_wins_its_size_squared_over_its_variance() -> None:
    # g° = 100·1, so named = 100²/100; u° = 0 + 60·1, so free = 60²/100.
    free, named, both, rank = one_against_one(60.0, 0.0)
    assert (float(free[0]), float(named[0]), rank) == pytest.approx((36.0, 100.0, 1))
    # Nothing is left for the function beside the name.
    assert both[0] == pytest.approx(100.0)


def test_the_free_form_wins_by_what_it_sees_beside_the_name_less_what_the_name_keeps() -> None:
    # u = 40 beside the name: efficient information 100 − 60²/100 = 64, so S = 40²/64 = 25.
    free, named, both, _ = one_against_one(60.0, 40.0)
    assert free[0] == pytest.approx((40 + 60) ** 2 / 100)
    assert both[0] == pytest.approx(100 + 25)
    # By hand: the joint step moves the name by −60·40/6400 = −3/8, so Z'² = (5/8)²·64.
    assert (both - free)[0] == pytest.approx((5 / 8) ** 2 * 64)
    assert named[0] == pytest.approx(100.0)


def test_what_else_the_fit_holds_is_projected_out_of_both() -> None:
    """A function that the rest of the fit can do as well has no rank and wins nothing."""
    A = np.diag([100.0, 50.0])
    free, named, both, rank = won(
        A, np.array([[0.0], [50.0]]), np.array([[50.0]]), np.zeros((1, 2)), np.zeros((1, 1)),
        np.array([1.0, 0.0]), np.array([True, False]),
    )  # fmt: skip
    assert (rank, float(free[0]), float(named[0]), float(both[0])) == (0, 0.0, 0.0, 0.0)


BETTER = Rival(("x",), "yaw", "pitch", 600.0, 400.0, 610.0, 9, 1, 20_000, (-50.0, 10.0))


def test_a_rival_must_pay_for_its_numbers() -> None:
    # 600 − 400 − 8 ln 20000 = 120.8
    assert BETTER.better == pytest.approx(120.8, abs=0.05)
    assert BETTER.wins
    assert not replace(BETTER, free=470.0).wins


def test_a_rival_does_not_win_where_flights_of_the_names_give_it_as_much() -> None:
    assert not replace(BETTER, nulls=(150.0, 10.0)).wins


def test_a_name_that_wins_as_much_beside_the_free_form_keeps_its_place() -> None:
    """Something else is left; it says nothing of this name."""
    assert not replace(BETTER, both=600.0 + 0.3 * 400.0).wins


def test_a_pitch_torque_of_the_voltages_product_is_not_two_names() -> None:
    both = ("motor.thrust_mismatch", "bias.torque.pitch")
    flight = seen("other.pitch_torque_from_voltage_product:0.0005", both, 1301)
    best = rival(flight, both)
    assert best is not None
    assert best.axis == "pitch"
    left = as_leftover(flight, best)
    assert left.depends_on in ("voltage_product", "voltage_sum")
    assert left.share > 0.3
    assert left.confidence > 0.99
    # About hover k V_f V_b rises by k V_o for each volt of the sum: 0.0005 · 7.46 N·m/V.
    if left.depends_on == "voltage_sum":
        z, torque = np.array(left.table).T
        slope = np.polyfit(z, torque, 1, w=1 / np.array(left.std))[0]
        assert slope == pytest.approx(0.0005 * 7.456, rel=0.25)


@pytest.mark.parametrize(
    ("hide", "names"),
    [
        ("motor.thrust_mismatch:1.1,bias.torque.pitch:-0.01",
         ("motor.thrust_mismatch", "bias.torque.pitch")),
        ("friction.coulomb.yaw:0.03", ("friction.coulomb.yaw",)),
    ],
)  # fmt: skip
def test_causes_that_are_there_keep_their_names(hide: str, names: tuple[str, ...]) -> None:
    flight = seen(hide, names, 1302)
    # A term's way from absent, along its own tangent: its value for one that is linear.
    free, values = flight.found.free[4], flight.found.values[4]
    assert away(flight.found)[4] == pytest.approx((values - free.null) / free.slope(values))
    assert rival(flight, names) is None
