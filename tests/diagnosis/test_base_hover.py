"""`--base hover`: `geometry` is found in flights with large motions only."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from heli3dof.diagnosis import diagnose as module
from heli3dof.diagnosis.diagnose import diagnose
from heli3dof.diagnosis.document import diagnosis_document
from heli3dof.diagnosis.result import Diagnosis
from heli3dof.diagnosis.search.catalogue import candidates
from heli3dof.errors import UsageError
from heli3dof.experiment.plan import step_plan
from heli3dof.model.base import Model
from heli3dof.model.model_file import save_model
from heli3dof.paper.models import load_model
from heli3dof.recording.recording import Recording
from heli3dof.recording.write import write_recording
from heli3dof.rig.profile import default_profile
from tests.cli.running import Result, heli3dof
from tests.flown import flown
from tests.profiles import profile


def names(result: Diagnosis) -> list[str]:
    return [f.term.name for f in result.findings]


@pytest.fixture(scope="module")
def flight() -> Recording:
    device = "mock:?speed=max&seed=1301&spread=0.07"
    return flown("rich", 30.0, device=device, seed=1301, profile=profile(rate_hz=250.0))


@pytest.fixture(scope="module")
def command(
    flight: Recording, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Result, Diagnosis]:
    """``diagnose --base hover``, and the diagnosis that it printed."""
    folder = tmp_path_factory.mktemp("hover")
    path = folder / "flight.mcap"
    write_recording(flight, path)
    made: list[Diagnosis] = []

    def kept(*args: Any, **options: Any) -> Diagnosis:
        made.append(diagnose(*args, **options))
        return made[-1]

    words = ("--base", "hover", "--quick", "-o", folder / "m.json", "--json")
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(module, "diagnose", kept)
        printed = heli3dof("diagnose", path, *words)
    return printed, made[0]


@pytest.fixture(scope="module")
def result(command: tuple[Result, Diagnosis]) -> Diagnosis:
    return command[1]


def test_geometry_is_a_candidate_only_for_the_hover_base() -> None:
    assert "geometry" not in [t.name for t in candidates()]
    with_hover = [t.name for t in candidates(["base.hover"])]
    assert "geometry" in with_hover
    assert "base.hover" not in with_hover
    assert "geometry" not in [t.name for t in candidates(["base.hover", "geometry"])]


def test_a_large_motion_gives_geometry_with_its_full_share_and_nothing_else(
    result: Diagnosis,
) -> None:
    assert result.verdict == "explained"
    assert names(result) == ["geometry"]
    share, std = result.findings[0].values["share"]
    assert abs(share - 1) < 3 * std < 0.2
    assert result.findings[0].tied_with == ()


def test_the_gain_of_geometry_is_relative_to_the_refitted_hover_model(result: Diagnosis) -> None:
    whole = result.fitted
    assert whole is not None
    assert [t.name for t in whole.base.structure.terms] == ["base.hover"]
    assert whole.gain.log_likelihood.low > 50
    before, after = whole.gain.before["roll"], whole.gain.after["roll"]
    assert before is not None
    assert after is not None
    assert after < 0.5 * before
    # Calibration is not part of the gain: the hover model with the profile's values is worse.
    assert whole.simulation_error.at(1.0, "roll")[0] > before


def test_the_command_diagnoses_the_linear_model(command: tuple[Result, Diagnosis]) -> None:
    printed, _ = command
    assert printed.code == 0, printed.err
    (body,) = (f for f in printed.document["findings"] if f["effect"] == "geometry")
    assert body["parameters"]["share"]["value"] == pytest.approx(1.0, abs=0.2)
    assert printed.document["about"]["base"] == "hover"
    model = load_model(Path(printed.document["model"]), default_profile())
    assert model.terms[0] == "base.hover"  # type: ignore[attr-defined]


def test_the_document_states_the_base(result: Diagnosis) -> None:
    d = diagnosis_document(result)
    assert d["about"]["base"] == "hover"
    (finding,) = d["findings"]
    assert (finding["effect"], finding["axis"]) == ("geometry", None)
    assert set(finding["parameters"]) == {"share"}


def test_the_extended_model_predicts_the_same_after_saving_and_loading(
    result: Diagnosis, flight: Recording, tmp_path
) -> None:  # type: ignore[no-untyped-def]
    assert result.fitted is not None
    model = result.fitted.model
    back: Model = load_model(save_model(model, tmp_path / "m.json"), flight.profile)
    part = flight.between(5.0, 8.0)
    assert back.predict(part, 0.5) == pytest.approx(model.predict(part, 0.5), nan_ok=True)


@pytest.mark.accuracy
def test_geometry_is_not_identifiable_in_a_flight_close_to_level() -> None:
    device = "mock:?speed=max&seed=1311&spread=0.07&start=level"
    small = flown(step_plan((2.0, None, None)), device=device, seed=1311)
    result = diagnose(small, quick=True, base="hover")
    assert "geometry" not in names(result)
    assert "geometry" in result.not_identifiable


def test_geometry_is_never_reported_for_the_rigid_base(flight: Recording) -> None:
    result = diagnose(flight.between(0.0, 15.0), quick=True)
    assert "geometry" not in [*names(result), *result.not_identifiable]
    assert result.about["base"] == "rigid"


def test_an_unknown_base_raises_an_error_with_the_nearest_name(flight: Recording) -> None:
    with pytest.raises(UsageError, match="hover"):
        diagnose(flight, base="hovr")
