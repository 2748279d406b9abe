"""Answers from diagnoses and from the student's own statements."""

from __future__ import annotations

from pathlib import Path

import pytest

from heli3dof.errors import RecordingError, UsageError
from heli3dof.exercise.answer import make_answer, read_answer, statements
from tests.exercise.making import EXERCISE, KEY, diagnosis, exercise_that


def test_a_diagnosis_gives_causes_intervals_and_the_hold_out_error() -> None:
    made = make_answer("Ada", EXERCISE, (), {"d.json": diagnosis(EXERCISE)})
    friction, unmodelled = made.causes
    assert (friction.name, friction.confidence) == ("friction.coulomb.yaw", 0.8 / 2)  # or viscous
    assert friction.tied_with == ("friction.viscous.yaw",)
    size = friction.parameters["torque_Nm"]
    assert (size.low, size.high) == pytest.approx((0.03 - 0.00196, 0.03 + 0.00196))
    assert (unmodelled.name, unmodelled.confidence) == ("unmodelled.roll", 0.6)
    assert made.holdout_rmse_deg == {"roll": 0.2, "pitch": 0.1, "yaw": None}


def test_a_quiet_diagnosis_claims_that_nothing_is_hidden() -> None:
    quiet = diagnosis(EXERCISE, findings=[], leftover=[], verdict="nothing_found")
    assert [c.name for c in make_answer("A", EXERCISE, (), {"d": quiet}).causes] == ["none"]
    bad = {**quiet, "verdict": "bad_data"}
    assert make_answer("A", EXERCISE, (), {"d": bad}).causes == ()
    own = statements(["inertia.yaw"], [])
    assert [c.name for c in make_answer("A", EXERCISE, own, {"d": quiet}).causes] == ["inertia.yaw"]


def test_an_error_that_no_torque_explains_is_no_claim() -> None:
    error = {"axis": "roll", "depends_on": None, "confidence": None}
    unexplained = diagnosis(EXERCISE, findings=[], leftover=[error], verdict="unexplained")
    assert make_answer("A", EXERCISE, (), {"d": unexplained}).causes == ()


def test_the_students_own_statements_replace_the_diagnosis() -> None:
    own = statements(["friction.coulomb.yaw=0.05±0.01"], [0.5])
    made = make_answer("Ada", EXERCISE, own, {"d.json": diagnosis(EXERCISE)})
    assert [c.name for c in made.causes] == ["friction.coulomb.yaw"]
    assert made.causes[0].parameters["torque_Nm"].value == 0.05
    assert made.holdout_rmse_deg is None  # that of the model with the diagnosis' causes
    none = make_answer("Ada", EXERCISE, statements(["none"], []), {"d": diagnosis(EXERCISE)})
    assert [c.name for c in none.causes] == ["none"]


def test_an_unmodelled_torque_has_no_size() -> None:
    with pytest.raises(UsageError, match=r"unmodelled\.yaw has no size"):
        statements(["unmodelled.yaw=0.1"], [])


def test_a_diagnosis_of_another_rig_is_refused() -> None:
    other = exercise_that(KEY, 1, count=1)
    both = {"exercises": [EXERCISE.id, other.id]}
    for document, fix in (
        (diagnosis(other), f"--exercise with the sealed file of exercise {other.id}"),
        (diagnosis(EXERCISE, about={}), "diagnose recordings of heli3dof run"),
        (diagnosis(EXERCISE, about=both), "diagnose recordings of heli3dof run"),
    ):
        what = f"not a diagnosis of exercise {EXERCISE.id} alone"
        with pytest.raises(UsageError, match=what) as caught:
            make_answer("Ada", EXERCISE, (), {"d.json": document})
        assert fix in str(caught.value.fix)


def test_an_incomplete_diagnosis_is_refused() -> None:
    with pytest.raises(RecordingError, match="not a complete diagnosis"):
        make_answer("Ada", EXERCISE, (), {"d.json": diagnosis(EXERCISE, findings=[{}])})


def test_statements_have_a_value_an_interval_and_a_confidence() -> None:
    texts = ["stiffness.cable.yaw=0.1±0.01", "inertia.yaw = 1.2 +- 0.1", "unmodelled.roll"]
    cable, inertia, unmodelled = statements(texts, [0.9, 0.8, 0.7])
    assert cable.text() == (
        "stiffness.cable.yaw, stiffness_Nm_per_rad = 0.1 (0.09 … 0.11), confidence 0.90"
    )
    assert inertia.parameters["ratio"].high == pytest.approx(1.3)
    assert (unmodelled.parameters, unmodelled.confidence) == ({}, 0.7)
    assert [c.confidence for c in statements(texts, [0.5])] == [0.5] * 3


def test_a_value_that_heli3dof_printed_is_accepted() -> None:
    (claim,) = statements(["bias.torque.pitch=−0.013±0.002"], [])
    assert claim.parameters["torque_Nm"].low == pytest.approx(-0.015)


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("drag.quadratic.elevation=0.3", "drag.quadratic.roll"),
        ("unmodelled.travel", "unmodelled.yaw"),
    ],
)
def test_elevation_and_travel_are_roll_and_yaw(text: str, name: str) -> None:
    assert [c.name for c in statements([text], [])] == [name]
    with pytest.raises(UsageError, match=f"names {name} twice"):
        statements([text, name], [])


@pytest.mark.parametrize(
    "text",
    [
        "inertia.yaw=",
        "inertia.yaw=x",
        "=1",
        "",
        "none=1",
        "inertia.yaw=1±y",
        "inertia.yaw=nan",
        "inertia.yaw=1±-0.1",
    ],
)
def test_a_statement_of_another_form_is_an_error(text: str) -> None:
    with pytest.raises(UsageError):
        statements([text], [])


@pytest.mark.parametrize(
    ("texts", "what"),
    [
        (["inertia.yaw=1.2", "none"], "none contradicts"),
        (["inertia.yaw=1.2", "inertia.yaw=1.3"], r"names inertia\.yaw twice"),
    ],
)
def test_contradictory_statements_are_an_error(texts: list[str], what: str) -> None:
    with pytest.raises(UsageError, match=what):
        statements(texts, [])


@pytest.mark.parametrize(("value", "fix"), [(90, "--confidence 0.9"), (-1, "--confidence 0.9")])
def test_a_confidence_in_percent_is_named(value: float, fix: str) -> None:
    with pytest.raises(UsageError, match="is not a probability from 0 to 1") as caught:
        statements(["none"], [value])
    assert caught.value.fix == fix


def test_the_number_of_confidences_must_match() -> None:
    with pytest.raises(UsageError, match="confidences: 2; of causes: 1"):
        statements(["none"], [0.1, 0.2])
    with pytest.raises(UsageError, match="confidences: 1; of causes: 0"):
        statements([], [0.1])


def test_an_answer_survives_its_file(tmp_path: Path) -> None:
    made = make_answer("Ada", EXERCISE, (), {"d.json": diagnosis(EXERCISE)})
    path = tmp_path / "answer.json"
    path.write_bytes(made.to_bytes())
    assert read_answer(path) == made
