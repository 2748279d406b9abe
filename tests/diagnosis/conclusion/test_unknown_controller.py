"""Without a controller, a cause must lower the error of predictions by more than rounding."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import pytest

from heli3dof.axes import AXES
from heli3dof.diagnosis import document
from heli3dof.diagnosis.base_parameters import OffNominal, base_parameters
from heli3dof.diagnosis.conclusion.adoption import objection
from heli3dof.diagnosis.conclusion.unknown_controller import confirmed, exceeds_rounding
from heli3dof.diagnosis.result import LIMIT_CYCLE, WITHIN_ROUNDING
from heli3dof.diagnosis.validation.cross_validation import held_out
from heli3dof.diagnosis.validation.gain import Interval
from heli3dof.identification.bias_correction.correction import CorrectedFit
from heli3dof.identification.closed_loop_fit.base_fit import LikelihoodWithInertiaPrior
from heli3dof.identification.greybox.estimate import estimate
from heli3dof.identification.row_selection import usable_runs
from heli3dof.model.effects import term
from heli3dof.model.estimation.filter_data import data_of
from heli3dof.model.greybox.linearisation import level_hover
from heli3dof.model.greybox.model import nominal
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.rig.profile import default_profile
from tests.flown import flown

PROFILE = default_profile()
"""4096 counts in roll and pitch, 8192 in yaw: Δ/√12 is 0.0254° and 0.0127°"""


def lowers(axis: str, value: float, low: float) -> Any:
    """Gain that lowers the RMSE of one axis by ``value`` degrees, at least by ``low``."""
    rmse = {a: Interval(value, low, 2 * value) if a == axis else None for a in AXES}
    return cast(Any, SimpleNamespace(rmse_deg=rmse, log_likelihood=Interval(50.0, 40.0, 60.0)))


@pytest.mark.parametrize(
    ("axis", "value", "low", "exceeds"),
    [
        ("yaw", 0.0130, 0.001, True),
        ("yaw", 0.0125, 0.001, False),  # less than rounding
        ("pitch", 0.0130, 0.001, False),  # a coarser encoder
        ("pitch", 0.3, -0.01, False),  # not significant
    ],
)
def test_predictions_must_improve_by_more_than_the_rounding_of_their_encoder(
    axis: str, value: float, low: float, exceeds: bool
) -> None:
    assert exceeds_rounding(lowers(axis, value, low), PROFILE) is exceeds


def fit_of(*implausible: str, simulated: bool) -> Any:
    """A fit with or without simulated flights, and the axes with an implausible base inertia."""
    problem = LikelihoodWithInertiaPrior(cast(Any, None), cast(Any, None), implausible=implausible)
    return SimpleNamespace(
        is_corrected=simulated, structure=SimpleNamespace(profile=PROFILE),
        problem=problem,
    )  # fmt: skip


def cause(name: str) -> Any:
    return SimpleNamespace(score=400.0, term=term(name))


@pytest.mark.parametrize(("simulated", "why"), [(False, WITHIN_ROUNDING), (True, "")])
def test_only_a_cause_without_simulated_flights_needs_better_predictions(
    simulated: bool, why: str
) -> None:
    fit, found = fit_of(simulated=simulated), cause("friction.coulomb.roll")
    assert objection(fit, found, lowers("roll", 0.001, 0.0005), first=True) == why


@pytest.mark.parametrize(
    ("name", "lowered", "implausible", "simulated", "why"),
    [
        ("friction.coulomb.roll", "roll", ("roll",), False, LIMIT_CYCLE),
        ("friction.coulomb.roll", "yaw", ("roll",), False, LIMIT_CYCLE),
        ("friction.coulomb.yaw", "yaw", ("roll",), False, ""),
        ("motor.dead_zone", "roll", ("roll",), False, LIMIT_CYCLE),
        ("motor.dead_zone", "pitch", ("roll",), False, ""),  # it acts on every axis
        ("friction.coulomb.roll", "roll", ("roll",), True, ""),
        ("friction.coulomb.roll", "roll", (), False, ""),
    ],
)
def test_without_simulated_flights_nothing_is_asserted_of_an_axis_with_an_implausible_inertia(
    name: str, lowered: str, implausible: tuple[str, ...], simulated: bool, why: str
) -> None:
    fit = fit_of(*implausible, simulated=simulated)
    assert objection(fit, cause(name), lowers(lowered, 0.3, 0.2), first=True) == why


@pytest.mark.parametrize(("hide", "names"), [("inertia.pitch:1.4", ["inertia.pitch"]), ("", [])])
def test_a_base_parameter_must_predict_better_than_the_profile_s_value(
    hide: str, names: list[str]
) -> None:
    url = f"mock:?speed=max&seed=1160&hide={hide}"
    r = flown("rich", 30.0, device=url, seed=1160)
    problem = LikelihoodWithInertiaPrior(data_of([r], usable_runs(r, 0)), Structure(r.profile, ()))
    fit = CorrectedFit(problem, estimate(problem).optimum)
    found = [OffNominal(term("inertia.pitch"), 1.4, 0.05, 64.0, 1.0)]
    left = confirmed(found, fit, held_out(fit, []), [], seed=0)
    assert [p.term.name for p in left] == names


def test_an_inertia_that_a_narrow_prior_holds_is_not_determined() -> None:
    r = flown("rich", 12.0, device="mock:?speed=max&seed=1160", seed=1160)
    problem = LikelihoodWithInertiaPrior(data_of([r], usable_runs(r, 0)), Structure(r.profile, ()))
    fit = CorrectedFit(replace(problem, implausible=("pitch",)), estimate(problem).optimum)
    model = nominal(r.profile)
    fitted = SimpleNamespace(final=fit, model=model, calibration=base_parameters(fit))
    found = document._ratios(cast(Any, fitted), level_hover(model))
    determined = [ratio["ratio"] for ratio in found]
    assert determined == ["V_o", "K_f/J_roll", "K_f/J_yaw"]
