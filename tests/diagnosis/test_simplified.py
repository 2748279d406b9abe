"""A rig that is a simulation by simplified equations has nothing wrong with it, and is told so."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from heli3dof.diagnosis.catalogue import candidates
from heli3dof.diagnosis.contenders import Contender
from heli3dof.diagnosis.diagnose import diagnose
from heli3dof.diagnosis.document import diagnosis_document
from heli3dof.diagnosis.noisy_flight import noisy_flight
from heli3dof.diagnosis.nulls import Nulls
from heli3dof.diagnosis.result import Diagnosis
from heli3dof.diagnosis.select import likeliest
from heli3dof.diagnosis.steps import surely
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import load_plan
from heli3dof.model.effects import term
from heli3dof.model.greybox.model import nominal
from heli3dof.recording.recording import Recording
from heli3dof.report import diagnosis_text as words

WRITTEN = ("simplified.couplings", "simplified.yaw_inertia")


def flown(*terms: str, seed: int, **values: float) -> Recording:
    """The rich plan, flown again by our own equations, by a third of the mock's noise."""
    mock = fly_plan(load_plan("rich"), device=f"mock:?speed=max&seed={seed}", seed=seed)
    model = nominal(mock.recording.profile, terms, **values)
    model = replace(model, noise=np.array([0.004, 0.01, 0.003]))
    return noisy_flight(model, mock.recording, np.random.default_rng(seed))


def names(found: Diagnosis) -> list[str]:
    return [f.choice.term.name for f in found.findings]


@pytest.fixture(scope="module")
def innocent() -> Diagnosis:
    return diagnose(flown(*WRITTEN, seed=1811), quick=True)


def test_a_rig_by_the_simplified_equations_is_accused_of_nothing(innocent: Diagnosis) -> None:
    assert innocent.verdict == "nothing_found"
    assert names(innocent) == []
    assert innocent.leftovers == ()
    assert innocent.dropped == ()


def test_the_document_says_how_its_equations_are_written_and_no_more(innocent: Diagnosis) -> None:
    d = diagnosis_document(innocent)
    assert d["about"]["written"] == [term(n).effect.summary for n in WRITTEN]
    assert list(words.equation_changes(d)) == d["about"]["written"]
    assert d["findings"] == []
    assert not any(n.startswith("simplified") for n in d["not_identifiable"])


def test_the_base_is_written_so_too_and_nothing_is_gained(innocent: Diagnosis) -> None:
    whole = innocent.fitted
    assert whole is not None
    assert {t.name for t in whole.model.structure.terms} == set(WRITTEN)
    assert {t.name for t in whole.base.structure.terms} == set(WRITTEN)
    assert whole.gain.log_likelihood.value == pytest.approx(0, abs=1e-9)
    share = dict(zip(whole.final.structure.names, whole.final.values, strict=True))
    assert share["simplified.couplings.share"] == pytest.approx(1, abs=0.3)


def test_a_cause_in_such_a_rig_is_the_only_one_named() -> None:
    hidden = {"stiffness.pendulum.pitch.torque_Nm": 0.03}
    found = diagnose(flown(*WRITTEN, "stiffness.pendulum.pitch", seed=1812, **hidden), quick=True)
    assert names(found) == ["stiffness.pendulum.pitch"]
    value, std = found.findings[0].values["torque_Nm"]
    assert abs(value - 0.03) < 3 * std < 0.01


def test_a_whole_body_is_not_said_to_be_simplified() -> None:
    found = diagnose(flown(seed=1813), quick=True)
    assert found.verdict == "nothing_found"
    assert found.about["written"] == []


def test_simpler_still_is_asked_for_only_where_couplings_are_left_out() -> None:
    own = {t.name for t in candidates() if t.effect.formal}
    assert own == set(WRITTEN)
    beside = {t.name for t in candidates(["simplified.couplings"]) if t.effect.formal}
    assert beside == {"simplified.yaw_inertia", "simplified.rates", "simplified.side_thrust"}


def contender(name: str, score: float, Z2: float) -> Contender:
    return Contender(term(name), cast(Any, None), cast(Any, None), score, Z2, None)


def chosen(*fits: Contender, first_score: float | None) -> str | None:
    nulls = Nulls(np.zeros(1), np.ones(1), 1.0, 20.0, 23.0, 16, "simulated")
    found = SimpleNamespace(free=())
    choice = likeliest(cast(Any, found), cast(Any, None), nulls, fits, first_score)
    return None if choice is None else choice.term.name


def test_what_is_too_weak_to_be_a_further_cause_may_still_be_how_the_body_is_written() -> None:
    couplings = contender("simplified.couplings", 60.0, 70.0)
    assert chosen(couplings, first_score=5000.0) == "simplified.couplings"
    drag = contender("drag.quadratic.yaw", 70.0, 80.0)
    assert chosen(drag, first_score=5000.0) is None
    assert chosen(drag, couplings, first_score=5000.0) == "simplified.couplings"
    assert chosen(drag, couplings, first_score=None) == "drag.quadratic.yaw"


def test_less_is_asked_of_it_than_of_a_cause() -> None:
    # t_23 exceeds 3.60 in a share 0.003/4 to one side: 3.60² (1 + 1/16) = 13.8, where a cause
    # among all needs the nulls' threshold
    nulls = Nulls(np.zeros(1), np.ones(1), 1.0, 20.0, 23.0, 16, "simulated")
    assert nulls.least(term("simplified.couplings")) == pytest.approx(13.8, abs=0.05)
    assert nulls.least(term("drag.quadratic.yaw")) == 20.0
    assert chosen(contender("simplified.couplings", 10.0, 15.0), first_score=None) is not None
    assert chosen(contender("drag.quadratic.yaw", 10.0, 15.0), first_score=None) is None


def test_the_other_way_of_writing_is_taken_along_where_it_is_as_plain() -> None:
    choice = cast(Any, SimpleNamespace(threshold=20.0))
    assert surely(contender("simplified.yaw_inertia", 25.0, 30.0), choice)
    assert not surely(contender("simplified.yaw_inertia", 15.0, 30.0), choice)
    assert not surely(contender("drag.quadratic.yaw", 250.0, 300.0), choice)
