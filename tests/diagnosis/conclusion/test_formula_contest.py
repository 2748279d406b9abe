"""A formula replaces causes that only imitate it, and never true causes."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from heli3dof.diagnosis.conclusion import formula_contest
from heli3dof.diagnosis.conclusion.formula_contest import contest, replaced_by_formula
from heli3dof.diagnosis.estimate.bias_correction import CorrectedFit
from heli3dof.diagnosis.unmodelled.unmodelled_torque import Place
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import load_plan
from heli3dof.identification.greybox.method import fit_greybox

TWO = ("motor.thrust_mismatch", "bias.torque.pitch")


@cache
def fitted(hide: str, causes: tuple[str, ...], seed: int) -> CorrectedFit:
    device = f"mock:?speed=max&hide={hide}"
    recording = fly_plan(load_plan("rich"), device=device, seed=seed).recording.between(0.0, 40.0)
    fit = fit_greybox(recording, causes)
    return CorrectedFit(fit.problem, fit.optimum)


def test_a_product_of_the_voltages_replaces_two_causes_on_pitch() -> None:
    fit = fitted("other.pitch_torque_from_voltage_product:0.0005", TWO, 1301)
    result = replaced_by_formula(fit, TWO)
    assert result is not None
    assert (result.causes, result.place) == (TWO, ("pitch", "voltage_product"))


@pytest.mark.parametrize(
    ("hide", "causes"),
    [
        ("motor.thrust_mismatch:1.1,bias.torque.pitch:-0.01", TWO),
        ("friction.coulomb.yaw:0.03", ("friction.coulomb.yaw",)),
        ("friction.viscous.yaw:0.1", ("friction.viscous.yaw",)),  # has the same formula
    ],
)
def test_true_causes_are_not_replaced(hide: str, causes: tuple[str, ...]) -> None:
    assert replaced_by_formula(fitted(hide, causes, 1302), causes) is None


def test_a_formula_pays_the_prior_odds_of_its_library(monkeypatch: pytest.MonkeyPatch) -> None:
    """With the same likelihood, one parameter for one: −2 ln(3 axes · P products)."""
    causes = ("friction.viscous.yaw",)
    fit = fitted("friction.viscous.yaw:0.1", causes, 1302)
    place = Place("yaw", "yaw_rate")
    monkeypatch.setattr(formula_contest, "with_best_product", lambda less: (7.0, place))
    odds = -2 * np.log(3 * len(formula_contest.PRODUCTS))
    assert contest(fit, 7.0, causes).margin == pytest.approx(odds)


def test_without_causes_there_is_no_contest() -> None:
    assert replaced_by_formula(None, ()) is None  # type: ignore[arg-type]
