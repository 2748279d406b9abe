"""A rig simulated by simplified equations has no finding; the document states the equations."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from heli3dof.diagnosis.diagnose import diagnose
from heli3dof.diagnosis.document import diagnosis_document
from heli3dof.diagnosis.result import Diagnosis
from heli3dof.diagnosis.search.candidate_fits import CandidateFit
from heli3dof.diagnosis.search.catalogue import candidates
from heli3dof.diagnosis.search.nulls import Nulls
from heli3dof.diagnosis.search.select import best_choice
from heli3dof.diagnosis.search.steps import is_significant_form
from heli3dof.identification.bias_correction.simulated_flight import simulated_flight
from heli3dof.model.effects import term
from heli3dof.model.greybox.model import nominal
from heli3dof.recording.recording import Recording
from heli3dof.report.text import diagnosis_sentences as words
from tests.flown import flown
from tests.profiles import profile

WRITTEN = ("simplified.couplings", "simplified.yaw_inertia")


def simulated(*terms: str, seed: int, **values: float) -> Recording:
    """Simulate 45 s of the rich plan by these equations, with a third of the mock's noise."""
    device = f"mock:?speed=max&seed={seed}"
    mock = flown("rich", 45.0, device=device, seed=seed, profile=profile(rate_hz=250.0))
    model = nominal(mock.profile, terms, **values)
    model = replace(model, noise=np.array([0.004, 0.01, 0.003]))
    return simulated_flight(model, mock, np.random.default_rng(seed))


def names(result: Diagnosis) -> list[str]:
    return [f.term.name for f in result.findings]


@pytest.fixture(scope="module")
def simplified() -> Diagnosis:
    return diagnose(simulated(*WRITTEN, seed=1811), quick=True)


def test_a_rig_with_simplified_equations_has_no_finding(simplified: Diagnosis) -> None:
    assert simplified.verdict == "nothing_found"
    assert names(simplified) == []
    assert simplified.residual_torques == ()
    assert simplified.dropped == ()


def test_the_document_states_the_form_of_the_equations_only(simplified: Diagnosis) -> None:
    d = diagnosis_document(simplified)
    assert d["about"]["written"] == [term(n).effect.summary for n in WRITTEN]
    assert list(words.equation_changes(d)) == d["about"]["written"]
    assert d["findings"] == []
    assert not any(n.startswith("simplified") for n in d["not_identifiable"])


def test_the_base_uses_the_same_equations_and_nothing_is_gained(simplified: Diagnosis) -> None:
    whole = simplified.fitted
    assert whole is not None
    assert {t.name for t in whole.model.structure.terms} == set(WRITTEN)
    assert {t.name for t in whole.base.structure.terms} == set(WRITTEN)
    assert whole.gain.log_likelihood.value == pytest.approx(0, abs=1e-9)
    share = dict(zip(whole.final.structure.names, whole.final.values, strict=True))
    assert share["simplified.couplings.share"] == pytest.approx(1, abs=0.3)


@pytest.mark.accuracy
def test_a_cause_in_such_a_rig_is_the_only_finding() -> None:
    hidden = {"stiffness.pendulum.pitch.torque_Nm": 0.03}
    result = diagnose(
        simulated(*WRITTEN, "stiffness.pendulum.pitch", seed=1812, **hidden), quick=True
    )
    assert names(result) == ["stiffness.pendulum.pitch"]
    value, std = result.findings[0].values["torque_Nm"]
    assert abs(value - 0.03) < 3 * std < 0.01


@pytest.mark.accuracy
def test_a_rigid_body_is_not_reported_as_simplified() -> None:
    result = diagnose(simulated(seed=1813), quick=True)
    assert result.verdict == "nothing_found"
    assert result.about["written"] == []


def test_further_simplifications_are_candidates_only_without_couplings() -> None:
    own = {t.name for t in candidates() if t.effect.formal}
    assert own == set(WRITTEN)
    with_couplings = {t.name for t in candidates(["simplified.couplings"]) if t.effect.formal}
    assert with_couplings == {
        "simplified.yaw_inertia",
        "simplified.rates",
        "simplified.side_thrust",
    }


def candidate(name: str, score: float, Z2: float) -> CandidateFit:
    return CandidateFit(term(name), cast(Any, None), cast(Any, None), score, Z2, None)


def chosen_name(*fits: CandidateFit, earlier_score: float | None) -> str | None:
    nulls = Nulls(np.zeros(1), np.ones(1), 1.0, 20.0, 23.0, 16, "simulated")
    choice = best_choice(cast(Any, SimpleNamespace(nulls=nulls)), fits, earlier_score)
    return None if choice is None else choice.term.name


def test_a_form_of_the_equations_needs_no_minimum_score_as_a_further_term() -> None:
    couplings = candidate("simplified.couplings", 60.0, 70.0)
    assert chosen_name(couplings, earlier_score=5000.0) == "simplified.couplings"
    drag = candidate("drag.quadratic.yaw", 70.0, 80.0)
    assert chosen_name(drag, earlier_score=5000.0) is None
    assert chosen_name(drag, couplings, earlier_score=5000.0) == "simplified.couplings"
    assert chosen_name(drag, couplings, earlier_score=None) == "drag.quadratic.yaw"


def test_the_threshold_is_lower_than_for_a_cause() -> None:
    # t_23 exceeds 3.60 with probability 0.003/4: 3.60² (1 + 1/16) = 13.8. A cause needs the nulls'
    # threshold, because it is one of many candidates.
    nulls = Nulls(np.zeros(1), np.ones(1), 1.0, 20.0, 23.0, 16, "simulated")
    assert nulls.threshold_of(term("simplified.couplings")) == pytest.approx(13.8, abs=0.05)
    assert nulls.threshold_of(term("drag.quadratic.yaw")) == 20.0
    form = candidate("simplified.couplings", 10.0, 15.0)
    assert chosen_name(form, earlier_score=None) is not None
    assert chosen_name(candidate("drag.quadratic.yaw", 10.0, 15.0), earlier_score=None) is None


def test_the_other_simplification_is_added_if_equally_clear() -> None:
    choice = cast(Any, SimpleNamespace(threshold=20.0))
    assert is_significant_form(candidate("simplified.yaw_inertia", 25.0, 30.0), choice)
    assert not is_significant_form(candidate("simplified.yaw_inertia", 15.0, 30.0), choice)
    assert not is_significant_form(candidate("drag.quadratic.yaw", 250.0, 300.0), choice)
