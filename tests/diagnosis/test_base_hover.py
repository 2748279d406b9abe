"""`--base hover`: the rigid body is found where a flight leaves level, and nowhere else."""

from __future__ import annotations

import pytest

from heli3dof.diagnosis.catalogue import candidates
from heli3dof.diagnosis.diagnose import diagnose
from heli3dof.diagnosis.document import diagnosis_document
from heli3dof.diagnosis.result import Diagnosis
from heli3dof.errors import UsageError
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import load_plan, step_plan
from heli3dof.model.base import Model
from heli3dof.model.model_file import save_model
from heli3dof.paper.models import load_model
from heli3dof.recording.recording import Recording


def names(found: Diagnosis) -> list[str]:
    return [f.choice.term.name for f in found.findings]


@pytest.fixture(scope="module")
def flight() -> Recording:
    device = "mock:?speed=max&seed=1301&spread=0.07"
    return fly_plan(load_plan("rich"), device=device, seed=1301).recording.between(0.0, 30.0)


@pytest.fixture(scope="module")
def found(flight: Recording) -> Diagnosis:
    return diagnose(flight, quick=True, base="hover")


def test_geometry_is_a_candidate_beside_the_hover_model_only() -> None:
    assert "geometry" not in [t.name for t in candidates()]
    beside = [t.name for t in candidates(["base.hover"])]
    assert "geometry" in beside
    assert "base.hover" not in beside
    assert "geometry" not in [t.name for t in candidates(["base.hover", "geometry"])]


def test_a_large_motion_asks_for_the_whole_of_the_rigid_body_and_nothing_else(
    found: Diagnosis,
) -> None:
    assert found.verdict == "explained"
    assert names(found) == ["geometry"]
    share, std = found.findings[0].values["share"]
    assert abs(share - 1) < 3 * std < 0.2
    assert found.findings[0].choice.tied_with == ()


def test_what_geometry_gains_is_gained_over_the_hover_model_refitted(found: Diagnosis) -> None:
    whole = found.fitted
    assert whole is not None
    assert [t.name for t in whole.base.structure.terms] == ["base.hover"]
    assert whole.gain.log_likelihood.low > 50
    before, after = whole.gain.before["roll"], whole.gain.after["roll"]
    assert before is not None
    assert after is not None
    assert after < 0.5 * before
    # Calibration is no gain: as the profile has it the hover model is further off still.
    assert whole.wrong.at(1.0, "roll")[0] > before


def test_the_document_says_which_base_was_judged(found: Diagnosis) -> None:
    d = diagnosis_document(found)
    assert d["about"]["base"] == "hover"
    (finding,) = d["findings"]
    assert (finding["effect"], finding["axis"]) == ("geometry", None)
    assert set(finding["parameters"]) == {"share"}


def test_the_extended_model_predicts_from_its_file_as_it_does_from_memory(
    found: Diagnosis, flight: Recording, tmp_path
) -> None:  # type: ignore[no-untyped-def]
    assert found.fitted is not None
    model = found.fitted.model
    back: Model = load_model(save_model(model, tmp_path / "m.json"), flight.profile)
    part = flight.between(5.0, 8.0)
    assert back.predict(part, 0.5) == pytest.approx(model.predict(part, 0.5), nan_ok=True)


def test_a_flight_that_hardly_leaves_level_does_not_tell() -> None:
    device = "mock:?speed=max&seed=1311&spread=0.07&start=level"
    small = fly_plan(step_plan((2.0, None, None)), device=device, seed=1311).recording
    found = diagnose(small, quick=True, base="hover")
    assert "geometry" not in names(found)
    assert "geometry" in found.not_identifiable


def test_with_the_rigid_body_for_a_base_geometry_is_never_spoken_of(flight: Recording) -> None:
    found = diagnose(flight.between(0.0, 15.0), quick=True)
    assert "geometry" not in [*names(found), *found.not_identifiable]
    assert found.about["base"] == "rigid"


def test_a_base_that_there_is_not_is_answered_with_the_nearest(flight: Recording) -> None:
    with pytest.raises(UsageError, match="hover"):
        diagnose(flight, base="hovr")
