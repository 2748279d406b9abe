"""An unmodelled torque gets no name, and its formula replaces causes that only imitate it.

A base fit distorted by the torque gets no null simulations.
"""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from heli3dof.diagnosis import diagnose as module
from heli3dof.diagnosis.conclusion import compensating_causes
from heli3dof.diagnosis.conclusion.adoption import AdoptionResult
from heli3dof.diagnosis.conclusion.compensating_causes import (
    predictions_agree,
    replaced_by_formula,
    replacement,
    simulations_refute,
)
from heli3dof.diagnosis.diagnose import Effort, diagnose
from heli3dof.diagnosis.document import diagnosis_document
from heli3dof.diagnosis.search.steps import screening_step
from heli3dof.diagnosis.unmodelled.unmodelled_torque import TorqueLocation
from heli3dof.diagnosis.validation.gain import Interval
from heli3dof.identification.bias_correction.correction import CorrectedFit
from heli3dof.identification.closed_loop_fit.base_fit import (
    LikelihoodWithInertiaPrior,
    corrected_base,
    fit_base,
    implausible_inertias,
)
from heli3dof.identification.closed_loop_fit.setup import Setup
from heli3dof.identification.greybox.method import fit_greybox
from heli3dof.identification.row_selection import usable_runs
from heli3dof.model.estimation.filter_data import data_of
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import default_profile
from tests.flown import flown
from tests.profiles import profile

BACKLASH = "encoder.backlash.roll"


def product(plan: str, seed: int, until_s: float = 90.0, also: str = "") -> Recording:
    """k V_f V_b on pitch, about hover a thrust mismatch and a constant torque; and other effects"""
    device = f"mock:?speed=max&hide=other.pitch_torque_from_voltage_product:0.0006{also}"
    return flown(plan, until_s, device=device, seed=seed, profile=profile(rate_hz=250.0))


def test_an_unmodelled_torque_gets_no_name_and_hides_no_cause(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The delay is found in the model with the torque's formula; both change the pitch inertia."""
    monkeypatch.setattr(module, "QUICK", Effort(6, 8, 3, 6))
    result = diagnose(product("rich", 1303, 30.0, also=",motor.delay:0.02"), quick=True)
    assert result.verdict == "unexplained"
    (delay,) = result.findings
    assert delay.term.name == "motor.delay"
    value, std = delay.values["delay_s"]
    assert abs(value - 0.02) < 3 * std
    # Causes that compensate for the torque about hover, or that compete with the delay.
    dropped = {d.name for d in result.dropped}
    assert "motor.thrust_mismatch" in dropped
    assert "motor.delay" not in dropped
    assert not result.calibration_findings
    document = diagnosis_document(result)
    (torque,) = document["leftover"]
    assert torque["formula"] == "c * voltage_front * voltage_back"
    c = torque["formula_parameters"]["c"]
    assert abs(c["value"] - 0.0006) < 3 * c["std"]
    gain = document["gain"]["holdout_rmse_deg"]
    assert gain["after"]["pitch"] < 0.1 * gain["before"]["pitch"]
    assert result.fitted is not None
    model = result.fitted.model
    assert torque["term"] in model.terms
    # The calibration is that of the extended model, whose inertias are in units of K_f.
    K_f, _, _, J_pitch, _ = (x["value"] for x in document["calibration"])
    assert J_pitch / K_f == pytest.approx(model.values[2] / model.profile.motor.K_f)


@pytest.mark.accuracy
def test_a_base_that_cannot_be_simulated_is_screened_without_nulls() -> None:
    """On steps alone the torque raises the pitch inertia until no controller stabilises the rig."""
    setup = Setup((product("steps", 1304),), seed=0, flights_per_round=6)
    runs = usable_runs(setup.recordings[0], 0)
    structure = Structure(setup.recordings[0].profile, ())
    base = corrected_base(
        setup, LikelihoodWithInertiaPrior(data_of(setup.recordings, runs), structure)
    )
    assert not base.is_corrected
    assert implausible_inertias(base)
    assert np.isfinite(base.values).all()
    step = screening_step(setup, base, flights=8)
    assert step.nulls.flights == 0
    assert step.nulls.method.endswith("flights simulated from the fit diverge")
    assert np.isfinite(step.recorded.z).all()
    # The screen still detects an effect.
    assert step.largest[0][1] > step.nulls.threshold
    # A diagnosis starts with inertias held to the profile: that model flies.
    assert fit_base(setup).score_covariance is not None


@pytest.mark.parametrize(("flies", "named"), [(True, ["drag.quadratic.yaw"]), (False, [BACKLASH])])
def test_a_fit_that_can_be_simulated_after_a_dropped_cause_is_adopted_again(
    monkeypatch: pytest.MonkeyPatch, flies: bool, named: list[str]
) -> None:
    """After bias correction the remaining causes may have another size, or none."""

    def settled_again(setup: Any, problem: Any, optimum: Any) -> Any:
        return SimpleNamespace(is_corrected=flies)

    def adopted(fit: Any, kept: Any, holdout: Any, *, seed: int) -> Any:
        assert [c.term.name for c in kept] == [BACKLASH]
        assert fit.is_corrected
        return AdoptionResult(fit, (finding("drag.quadratic.yaw"),), (), cast(Any, None))

    def finding(name: str) -> Any:
        choice = SimpleNamespace(term=SimpleNamespace(name=name, effect=SimpleNamespace(of_base=0)))
        return SimpleNamespace(choice=choice, term=choice.term, gain=None)

    monkeypatch.setattr(compensating_causes, "bias_corrected", settled_again)
    monkeypatch.setattr(compensating_causes, "adopted", adopted)
    monkeypatch.setattr(compensating_causes, "evidence", lambda *a, **k: SimpleNamespace(null=()))
    monkeypatch.setattr(compensating_causes, "replaced_by_formula", lambda *a: None)
    monkeypatch.setattr(compensating_causes, "significant_torques", lambda *a: ())
    fit = SimpleNamespace(is_corrected=False, problem=None, optimum=None)
    setup = SimpleNamespace(recordings=(), seed=0)
    start = AdoptionResult(cast(Any, fit), (finding(BACKLASH),), (), cast(Any, None))
    last = compensating_causes.search_residual_torques(cast(Any, setup), start, [], flights=8)
    assert [f.term.name for f in last.findings] == named


TWO = ("motor.thrust_mismatch", "bias.torque.pitch")
SETUP = Setup((), seed=0, flights_per_round=6)


@cache
def fitted(hide: str, causes: tuple[str, ...], seed: int) -> CorrectedFit:
    device = f"mock:?speed=max&hide={hide}"
    recording = flown("rich", 40.0, device=device, seed=seed, profile=profile(rate_hz=250.0))
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
    monkeypatch.setattr(compensating_causes, "with_best_product", lambda less: formula)
    odds = -2 * np.log(3 * len(compensating_causes.PRODUCTS))
    assert replacement(fit, 7.0, causes).margin == pytest.approx(odds)


def test_without_causes_there_is_nothing_to_replace() -> None:
    assert replaced_by_formula(SETUP, None, (), ()) is None  # type: ignore[arg-type]


@pytest.mark.parametrize(("recorded", "refuted"), [(300.0, False), (-40.0, True), (120.0, True)])
def test_a_likelihood_that_flights_with_the_causes_have_too_replaces_nothing(
    monkeypatch: pytest.MonkeyPatch, recorded: float, refuted: bool
) -> None:
    """ln L of the formula minus that of the causes is 290 to 310 in flights with the causes, −50 to
    −30 in flights with the formula. At 120, neither is the whole cause.
    """
    causes = [[0.0, 300.0 + d] for d in (-10, -5, 0, 5, 10)]
    formula = [[0.0, -40.0 + d] for d in (-10, -5, 0, 5, 10)]
    monkeypatch.setattr(compensating_causes, "correct", lambda *a, **k: None)
    flights = np.array([causes, formula])
    recording = np.array([0.0, recorded])
    monkeypatch.setattr(compensating_causes, "likelihoods", lambda *a, **k: (recording, flights))
    setup = cast(
        Setup, SimpleNamespace(controller_is_known=True, recordings=(), seed=0, flights_per_round=6)
    )
    o = SimpleNamespace(theta=None, noise=None)
    fit = cast(Any, SimpleNamespace(is_corrected=True))
    formula = cast(Any, SimpleNamespace(problem=None, optimum=o))
    assert simulations_refute(setup, fit, formula) is refuted


@pytest.mark.parametrize(("decrease_deg", "agrees"), [(0.1, True), (0.01, False)])
def test_without_a_controller_the_formula_must_predict_its_axis_better_than_rounding(
    monkeypatch: pytest.MonkeyPatch, decrease_deg: float, agrees: bool
) -> None:
    """Rounding to a count of 360°/4096 has the standard deviation 0.025°."""
    lower = Interval(decrease_deg, 0.9 * decrease_deg, 1.1 * decrease_deg)
    gained = SimpleNamespace(rmse_deg={"roll": lower, "pitch": None, "yaw": None})
    monkeypatch.setattr(compensating_causes, "held_out", lambda *a: None)
    monkeypatch.setattr(compensating_causes, "gain", lambda *a, **k: gained)
    setup = cast(Setup, SimpleNamespace(seed=0))
    fit = cast(Any, SimpleNamespace(structure=SimpleNamespace(profile=default_profile())))
    formula = cast(
        Any, SimpleNamespace(problem=None, optimum=None, location=TorqueLocation("roll", "yaw"))
    )
    assert predictions_agree(setup, fit, formula, ()) is agrees
