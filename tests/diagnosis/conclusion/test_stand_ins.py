"""An unmodelled torque gets no name; a base fit distorted by it gets no null simulations."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from heli3dof.diagnosis.conclusion import stand_ins
from heli3dof.diagnosis.conclusion.adoption import AdoptionResult
from heli3dof.diagnosis.diagnose import diagnose
from heli3dof.diagnosis.document import diagnosis_document
from heli3dof.diagnosis.selection.steps import screening_step
from heli3dof.identification.closed_loop_fit.base_fit import (
    ProfileLikelihood,
    corrected_base,
    fit_base,
    implausible_inertias,
)
from heli3dof.identification.closed_loop_fit.setup import Setup
from heli3dof.identification.greybox.usable_runs import usable_runs
from heli3dof.model.estimation.filter_data import data_of
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.recording.recording import Recording
from tests.flown import flown

BACKLASH = "encoder.backlash.roll"


def product(plan: str, seed: int, until_s: float = 90.0) -> Recording:
    """k V_f V_b on pitch: about hover a thrust mismatch and a constant torque."""
    device = "mock:?speed=max&hide=other.pitch_torque_from_voltage_product:0.0006"
    return flown(plan, until_s, device=device, seed=seed)


def test_an_unmodelled_torque_gets_no_asserted_name() -> None:
    result = diagnose(product("rich", 1303, 30.0), quick=True)
    assert result.verdict == "unexplained"
    assert result.residual_torques[0].axis == "pitch"
    # Its stand-in about hover is either dropped or reported as "-like".
    assert all(f.unconfirmed for f in result.findings)
    named = {f.term.name for f in result.findings} | {d.name for d in result.dropped}
    assert "motor.thrust_mismatch" in named
    assert not result.calibration_findings
    (torque,) = diagnosis_document(result)["leftover"]
    assert torque["formula"] == "c * voltage_front * voltage_back"
    c = torque["formula_parameters"]["c"]
    assert abs(c["value"] - 0.0006) < 3 * c["std"]
    gain = diagnosis_document(result)["gain"]["holdout_rmse_deg"]
    assert gain["after"]["pitch"] < 0.2 * gain["before"]["pitch"]
    assert result.fitted is not None
    assert torque["term"] in result.fitted.model.terms


@pytest.mark.accuracy
def test_a_base_that_cannot_be_simulated_is_screened_without_nulls() -> None:
    """On steps alone the torque raises the pitch inertia until no controller stabilises the rig."""
    setup = Setup((product("steps", 1304),), seed=0, flights_per_round=6)
    runs = usable_runs(setup.recordings[0], 0)
    structure = Structure(setup.recordings[0].profile, ())
    base = corrected_base(setup, ProfileLikelihood(data_of(setup.recordings, runs), structure))
    assert not base.is_corrected
    assert implausible_inertias(base)
    assert np.isfinite(base.values).all()
    step = screening_step(setup, base, flights=8)
    assert step.nulls.flights == 0
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

    monkeypatch.setattr(stand_ins, "bias_corrected", settled_again)
    monkeypatch.setattr(stand_ins, "adopted", adopted)
    monkeypatch.setattr(stand_ins, "evidence", lambda *a, **k: SimpleNamespace(null=()))
    monkeypatch.setattr(stand_ins, "replaced_by_formula", lambda *a: None)
    monkeypatch.setattr(stand_ins, "significant_torques", lambda *a: ())
    monkeypatch.setattr(stand_ins, "marked_unconfirmed", lambda findings, fit: findings)
    fit = SimpleNamespace(is_corrected=False, problem=None, optimum=None)
    setup = SimpleNamespace(recordings=(), seed=0)
    start = AdoptionResult(cast(Any, fit), (finding(BACKLASH),), (), cast(Any, None))
    last = stand_ins.settle_unmodelled(cast(Any, setup), start, [], flights=8)
    assert [f.term.name for f in last.findings] == named
