"""A formula replaces causes that only imitate it, and never true causes."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from heli3dof.diagnosis.conclusion import formula_contest
from heli3dof.diagnosis.conclusion.formula_contest import (
    contest,
    predictions_agree,
    replaced_by_formula,
    simulations_agree,
)
from heli3dof.diagnosis.unmodelled.unmodelled_torque import TorqueLocation
from heli3dof.diagnosis.validation.gain import Interval
from heli3dof.identification.bias_correction.correction import CorrectedFit
from heli3dof.identification.closed_loop_fit.setup import Setup
from heli3dof.identification.greybox.method import fit_greybox
from heli3dof.rig.profile import default_profile
from tests.flown import flown

TWO = ("motor.thrust_mismatch", "bias.torque.pitch")


SETUP = Setup((), seed=0, flights_per_round=6)


@cache
def fitted(hide: str, causes: tuple[str, ...], seed: int) -> CorrectedFit:
    device = f"mock:?speed=max&hide={hide}"
    recording = flown("rich", 40.0, device=device, seed=seed)
    fit = fit_greybox(recording, causes)
    return CorrectedFit(fit.problem, fit.optimum)


def test_a_product_of_the_voltages_replaces_two_causes_on_pitch() -> None:
    fit = fitted("other.pitch_torque_from_voltage_product:0.0005", TWO, 1301)
    result = replaced_by_formula(SETUP, fit, TWO, ())
    assert result is not None
    assert (result.causes, result.formula.location) == (TWO, ("pitch", "voltage_product"))


@pytest.mark.parametrize(
    ("hide", "causes"),
    [
        ("motor.thrust_mismatch:1.1,bias.torque.pitch:-0.01", TWO),
        ("friction.coulomb.yaw:0.03", ("friction.coulomb.yaw",)),
        ("friction.viscous.yaw:0.1", ("friction.viscous.yaw",)),  # has the same formula
    ],
)
def test_true_causes_are_not_replaced(hide: str, causes: tuple[str, ...]) -> None:
    assert replaced_by_formula(SETUP, fitted(hide, causes, 1302), causes, ()) is None


def test_a_formula_pays_the_prior_odds_of_its_library(monkeypatch: pytest.MonkeyPatch) -> None:
    """With the same likelihood, one parameter for one: −2 ln(3 axes · P products)."""
    causes = ("friction.viscous.yaw",)
    fit = fitted("friction.viscous.yaw:0.1", causes, 1302)
    formula = SimpleNamespace(
        optimum=SimpleNamespace(loglik=7.0), location=TorqueLocation("yaw", "yaw_rate")
    )
    monkeypatch.setattr(formula_contest, "with_best_product", lambda less: formula)
    odds = -2 * np.log(3 * len(formula_contest.PRODUCTS))
    assert contest(fit, 7.0, causes).margin == pytest.approx(odds)


def test_without_causes_there_is_no_contest() -> None:
    assert replaced_by_formula(SETUP, None, (), ()) is None  # type: ignore[arg-type]


@pytest.mark.parametrize(("recorded", "agrees"), [(300.0, False), (-40.0, True)])
def test_a_likelihood_that_flights_with_the_causes_have_too_replaces_nothing(
    monkeypatch: pytest.MonkeyPatch, recorded: float, agrees: bool
) -> None:
    """ln L of the formula minus that of the causes is 290 to 310 in flights with the causes."""
    causes = [[0.0, 300.0 + d] for d in (-10, -5, 0, 5, 10)]
    formula = [[0.0, -40.0 + d] for d in (-10, -5, 0, 5, 10)]
    monkeypatch.setattr(formula_contest, "correct", lambda *a, **k: None)
    flights = np.array([causes, formula])
    recording = np.array([0.0, recorded])
    monkeypatch.setattr(formula_contest, "likelihoods", lambda *a, **k: (recording, flights))
    setup = cast(
        Setup, SimpleNamespace(controller_is_known=True, recordings=(), seed=0, flights_per_round=6)
    )
    o = SimpleNamespace(theta=None, noise=None)
    fit = cast(Any, SimpleNamespace(is_corrected=True))
    formula = cast(Any, SimpleNamespace(problem=None, optimum=o))
    assert simulations_agree(setup, fit, formula) is agrees


@pytest.mark.parametrize(("decrease_deg", "agrees"), [(0.1, True), (0.01, False)])
def test_without_a_controller_the_formula_must_predict_its_axis_better_than_rounding(
    monkeypatch: pytest.MonkeyPatch, decrease_deg: float, agrees: bool
) -> None:
    """Rounding to a count of 360°/4096 has the standard deviation 0.025°."""
    lower = Interval(decrease_deg, 0.9 * decrease_deg, 1.1 * decrease_deg)
    gained = SimpleNamespace(rmse_deg={"roll": lower, "pitch": None, "yaw": None})
    monkeypatch.setattr(formula_contest, "held_out", lambda *a: None)
    monkeypatch.setattr(formula_contest, "gain", lambda *a, **k: gained)
    setup = cast(Setup, SimpleNamespace(seed=0))
    fit = cast(Any, SimpleNamespace(structure=SimpleNamespace(profile=default_profile())))
    formula = cast(
        Any, SimpleNamespace(problem=None, optimum=None, location=TorqueLocation("roll", "yaw"))
    )
    assert predictions_agree(setup, fit, formula, ()) is agrees
