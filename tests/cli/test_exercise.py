"""``exercise``: the whole round, from the sealed rig to the marks of a class."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from heli3dof.cli.exercise import _holdout, _table
from heli3dof.recording.mcap_files.reader import read_recording
from heli3dof.recording.provenance import exercise_ids
from tests.cli.running import Result, heli3dof
from tests.exercise.making import EXERCISE, diagnosis, key_file

STEP = ("run-step", "--roll", "5", "--settle", "0.5", "--duration", "2")


class Class:
    """A folder with a key, an exercise, a flight on it, and a folder of answers."""

    def __init__(self, folder: Path) -> None:
        self.key, self.exercise = key_file(folder), folder / "rig.exercise"
        self.flight, self.answers = folder / "a.mcap", folder / "answers"
        self.answers.mkdir()
        self.made = heli3dof(
            "exercise", "new", "--seed", "7", "--level", "1", "--key", self.key,
            "-o", self.exercise, "--json",
        )  # fmt: skip
        self.truth = heli3dof(
            "exercise", "open", self.exercise, "--key", self.key, "--json"
        ).document

    def fly(self) -> Result:
        device = f"mock:?speed=max&start=level&exercise={self.exercise}"
        return heli3dof(*STEP, "--device", device, "-o", self.flight)

    def submit(self, file: str, *words: object) -> Result:
        return heli3dof(
            "exercise", "submit", "--exercise", self.exercise, "--name", file.removesuffix(".json"),
            "-o", self.answers / file, *words,
        )  # fmt: skip

    def mark(self, *words: object) -> Result:
        return heli3dof("exercise", "mark", self.answers, "--key", self.key, *words)


@pytest.fixture
def lab(tmp_path: Path) -> Class:
    return Class(tmp_path)


def test_the_whole_round(lab: Class) -> None:
    assert lab.made.code == 0
    assert lab.fly().code == 0
    recording = read_recording(lab.flight)
    exercise = lab.made.document["exercise"]
    assert exercise_ids([recording, replace(recording, meta={})]) == [exercise, None]
    assert exercise_ids([replace(recording, meta={})]) is None

    (hidden,) = lab.truth["causes"]
    value = next(iter(hidden["parameters"].values()))
    lab.submit(
        "right.json", "--cause", f"{hidden['name']}={value}±{abs(value)}", "--confidence", "0.9"
    )
    lab.submit("wrong.json", "--cause", "none", "--confidence", "0.9")
    rows = lab.mark("--json").document["rows"]
    right, wrong = rows
    assert (right["right"], right["missed"]) == ([hidden["name"]], [])
    assert right["sizes"][0]["relative_error"] == 0
    assert right["sizes"][0]["inside"]
    assert right["brier"] == pytest.approx(0.01)
    assert (wrong["wrong"], wrong["brier"]) == (["none"], pytest.approx(1.81))
    text = lab.mark()
    assert "1 of 1" in text.out
    assert f"hides {hidden['name']}" in text.out


def test_no_file_of_the_student_reveals_the_effect(lab: Class) -> None:
    lab.fly()
    (hidden,) = lab.truth["causes"]
    parts = hidden["name"].encode().split(b".")
    secrets = [hidden["name"].encode(), *(p for p in parts if len(p) > 5)]
    recording = read_recording(lab.flight)
    shown = json.dumps(dict(recording.meta), default=str) + json.dumps(recording.profile.to_dict())
    info = heli3dof("info", lab.flight, "--json")
    seen = [lab.exercise.read_bytes(), lab.flight.read_bytes(), shown.encode(), info.out.encode()]
    assert not [s for s in secrets for each in seen if s in each]


def test_a_diagnosis_of_the_exercise_is_accepted_and_of_another_rig_refused(
    lab: Class, tmp_path: Path
) -> None:
    document = diagnosis_file(tmp_path, lab.made.document["exercise"])
    result = lab.submit("a.json", document, "--json")
    assert result.code == 0, result.err
    assert result.document["causes"][0]["name"] == "friction.coulomb.yaw"
    other = diagnosis_file(tmp_path, "0" * 12)
    refused = lab.submit("b.json", other)
    assert refused.code == 2
    assert "not a diagnosis of exercise" in refused.err
    row = lab.mark("--json").document["rows"][0]
    assert row["holdout_rmse_deg"] == {"roll": 0.2, "pitch": 0.1, "yaw": None}


def diagnosis_file(folder: Path, exercise: str) -> Path:
    path = folder / "diagnosis.json"
    path.write_text(json.dumps(diagnosis(EXERCISE, about={"exercises": [exercise]})))
    return path


def test_files_that_cannot_be_marked_are_rows_with_their_reason(lab: Class) -> None:
    lab.submit("good.json", "--cause", "none")
    text = (lab.answers / "good.json").read_text()
    changed = json.loads(text)
    changed["exercise"]["level"] = 2
    elsewhere = {**json.loads(text), "flown_on": ["0" * 12], "name": "\x1b[31m"}
    for name, content in {
        "changed.json": json.dumps(changed), "cut.json": text[:300], "deep.json": "[" * 10**5,
        "elsewhere.json": json.dumps(elsewhere), "large.json": " " * 2_000_000,
        "notes.txt": "Hello",
    }.items():  # fmt: skip
        (lab.answers / name).write_text(content)
    (lab.answers / "folder").mkdir()
    result = lab.mark("--json")
    assert result.code == 0
    reasons = {r["file"]: r["reason"] for r in result.document["rows"]}
    assert reasons.pop("good.json") is None
    assert "changed after it was sealed" in reasons.pop("changed.json")
    assert "recordings are of 000000000000" in reasons.pop("elsewhere.json")
    assert "bytes" in reasons.pop("large.json")
    assert {r.split(" ", 1)[1].split(" (")[0].rstrip(".") for r in reasons.values()} == {
        "is not an answer"
    }
    assert "\x1b" not in result.out


def test_the_wrong_key_marks_nothing(lab: Class, tmp_path: Path) -> None:
    lab.submit("a.json", "--cause", "none")
    other = tmp_path / "other.key"
    new = ("exercise", "new", "--level", "1", "--key", other, "-o", tmp_path / "o.exercise")
    assert f"a new teacher's key was written to {other}" in heli3dof(*new).err
    result = heli3dof("exercise", "mark", lab.answers, "--key", other, "--json")
    assert result.code == 6
    (row,) = result.document["rows"]
    assert row["reason"] == "another teacher's key sealed the exercise"
    assert row["hidden"] == []
    assert heli3dof("exercise", "open", lab.exercise, "--key", other).code == 5


def test_bad_input_has_the_exit_codes_of_the_contract(lab: Class, tmp_path: Path) -> None:
    assert heli3dof("exercise", "new", "--level", "6").code == 2
    again = ("exercise", "new", "--level", "1", "--key", lab.key, "-o", lab.exercise)
    assert heli3dof(*again).code == 2
    assert heli3dof(*again, "--force").code == 0
    assert lab.submit("a.json").code == 2
    assert lab.submit("a.json", "--cause", "no.such").code == 2
    assert lab.submit("a.json", lab.exercise).code == 5
    assert lab.mark().code == 2, "no answers"
    assert heli3dof("exercise", "mark", tmp_path / "none", "--key", lab.key).code == 2
    changed = lab.exercise.read_text().replace('"level": 1', '"level": 2')
    lab.exercise.write_text(changed)
    assert lab.fly().code == 5
    assert not lab.flight.exists()


def test_the_errors_of_the_three_axes_fit_one_line() -> None:
    assert _holdout({"roll": 0.2, "pitch": None, "yaw": 0.09}) == "0.20/–/0.09°"
    assert _holdout(None) == "–"


def test_answers_of_the_same_name_are_told_apart_by_their_files() -> None:
    row = {
        "exercise": "3f9a2b7c1d4e", "reason": None, "name": "Ada", "file": "ada.json", "right": [],
        "hidden": [], "wrong": [], "confounded": [], "sizes": [], "brier": 0.1,
        "holdout_rmse_deg": None,
    }  # fmt: skip
    bobs = [{**row, "name": n, "file": f} for n, f in
            (("bob", "2.json"), ("Bob", "1.json"), ("Bob ", "3.json"))]  # fmt: skip
    cells = [each[0] for each in _table([*bobs, row]).rows]
    assert cells == ["Ada", "Bob\n(1.json)", "bob\n(2.json)", "Bob\n(3.json)"]


def test_the_marks_of_several_exercise_ids_break_no_id_and_no_name_at_80_columns() -> None:
    row = {
        "exercise": "3f9a2b7c1d4e", "reason": None, "name": "Annemarie Schwarzenbach",
        "file": "a.json", "right": [], "hidden": [{"name": "motor.lag"}],
        "wrong": ["stiffness.pendulum.pitch"], "confounded": ["disturbance.periodic.pitch"],
        "sizes": [{"relative_error": 0.5, "inside": True}, {"relative_error": 0.1, "inside": None}],
        "brier": 0.12, "holdout_rmse_deg": {"roll": 12.2, "pitch": 10.3, "yaw": 100.01},
    }  # fmt: skip
    rows = [row, {**row, "exercise": "222222222222", "name": "Bo"}]
    rows.append({**row, "reason": "it is not a JSON file", "file": f"{'long-name-' * 3}.json"})
    text = io.StringIO()
    Console(file=text, width=80).print(_table(rows))
    for whole in (
        "3f9a2b7c1d4e", "222222222222", "stiffness.pendulum.pitch", "disturbance.periodic.pitch",
        "12.20/10.30/100.01°", "size error", "interval", "Annemarie Schwarzenbach",
    ):  # fmt: skip
        assert whole in text.getvalue()
    assert max(map(len, text.getvalue().splitlines())) <= 80
