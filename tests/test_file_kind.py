"""Messages suggest only files of the kind that an argument needs."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from heli3dof.errors import PlanError, ProfileError, RecordingError, UsageError
from heli3dof.experiment.plan import load_plan
from heli3dof.model.model_file import read_model
from heli3dof.paper.models import load_model
from heli3dof.recording.load import load
from heli3dof.rig.profile import load_profile

PLAN = 'name = "x"\n[[segment]]\nkind = "hold"\nduration_s = 5\n'
PROFILE = "[geometry]\nL_w = 0.47\n"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with plans, a profile and JSON documents of similar names."""
    monkeypatch.chdir(tmp_path)
    for name, text in {
        "seg.toml": PLAN, "big.toml": PLAN, "deg2.toml": PLAN, "rig ü.toml": PROFILE,
    }.items():  # fmt: skip
        Path(name).write_text(text, encoding="utf-8")
    for name, content in {
        "diagnosis.json": {"schema": "heli3dof.diagnosis/1", "model": "s1-extended.json"},
        "identified.json": {"schema": "heli3dof.identification/1", "models": [{"file": "m.json"}]},
        "compared.json": {"schema": "heli3dof.comparison/1", "models": None},
        "s1-extended.json": {"schema": "heli3dof.model/1"},
    }.items():
        Path(name).write_text(json.dumps(content), encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize(
    ("name", "meant"), [("steps.toml", "'steps'"), ("deg2", "deg2.toml"), ("SEG", "seg.toml")]
)
def test_a_missing_plan_names_a_plan(name: str, meant: str) -> None:
    with pytest.raises(PlanError) as caught:
        load_plan(name)
    assert f"did you mean {meant}?" in caught.value.cause


def test_a_plan_without_a_similar_name_lists_the_plans() -> None:
    with pytest.raises(PlanError, match=r"one of: chirp, .*steps"):
        load_plan("zzzz")


def test_a_missing_profile_names_a_profile() -> None:
    with pytest.raises(ProfileError) as caught:
        load_profile("Rig.toml")
    assert "did you mean rig ü.toml?" in caught.value.cause


def test_a_missing_model_names_a_model_file() -> None:
    with pytest.raises(RecordingError, match=r"did you mean s1-extended\.json"):
        read_model("s1_extended.json")
    with pytest.raises(RecordingError) as caught:
        read_model("diagnoses.json")
    assert "did you mean" not in caught.value.cause
    with pytest.raises(UsageError, match="did you mean 'hover'"):
        load_model("hoover")


def test_a_toml_file_of_another_kind_is_named() -> None:
    with pytest.raises(PlanError, match="is a profile, not a plan") as plan:
        load_plan("rig ü.toml")
    assert plan.value.fix == "--profile 'rig ü.toml'"
    with pytest.raises(ProfileError, match="is a plan, not a profile") as profile:
        load_profile("seg.toml")
    assert profile.value.fix == "heli3dof run seg.toml"


@pytest.mark.parametrize(
    ("name", "kind", "fix"),
    [
        ("seg.toml", "a plan", "heli3dof run seg.toml"),
        ("rig ü.toml", "a profile", "--profile 'rig ü.toml'"),
        ("s1-extended.json", "a model file", "heli3dof compare REC... s1-extended.json"),
        ("diagnosis.json", "the output of heli3dof diagnose --json", "REC.mcap s1-extended.json"),
        ("identified.json", "the output of heli3dof identify --json", "REC.mcap m.json"),
        ("compared.json", "the output of heli3dof compare --json", "the recordings"),
    ],
)
def test_a_file_given_as_a_recording_is_named_by_its_content(
    name: str, kind: str, fix: str
) -> None:
    with pytest.raises(RecordingError) as caught:
        load(name)
    assert f"it is {kind}." in caught.value.what
    assert fix in caught.value.fix


def test_a_diagnosis_given_as_a_model_names_its_model_file() -> None:
    with pytest.raises(RecordingError) as caught:
        read_model("diagnosis.json")
    assert caught.value.fix == "give its model file: s1-extended.json"
