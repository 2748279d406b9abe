"""Mark the answers of a class of students: the files in a folder and its subfolders."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from heli3dof.errors import Heli3dofError, UsageError, quoted
from heli3dof.exercise.answer import Answer, read_answer
from heli3dof.exercise.marks import Mark, mark
from heli3dof.exercise.teacher_key import Truth, open_truth, signature_problem

if TYPE_CHECKING:
    from nacl.signing import SigningKey

NOT_ANSWERS = (".mcap", ".exercise")
"""Endings of the files in the folder that are not answers"""


@dataclass(frozen=True)
class MarkedAnswer:
    """An answer file and its marks, or the reason why the file has no marks."""

    file: str
    answer: Answer | None
    truth: Truth | None
    mark: Mark | None
    reason: str | None

    def document(self) -> dict[str, Any]:
        """Return the marks as a dict of JSON types; without marks, with None and empty lists."""
        answer, truth = self.answer, self.truth
        return {
            "file": self.file,
            "name": None if answer is None else _printable(answer.name),
            "exercise": None if answer is None else answer.exercise.id,
            "level": None if answer is None else answer.exercise.level,
            "reason": self.reason,
            "hidden": []
            if truth is None
            else [{"name": c.name, "parameters": dict(c.values)} for c in truth.causes],
            **_marks(self.mark),
            "holdout_rmse_deg": None if answer is None else answer.holdout_rmse_deg,
        }


def _marks(mark: Mark | None) -> dict[str, Any]:
    marks = asdict(mark or Mark((), (), (), (), (), None))
    return {**marks, "wrong": [_printable(name) for name in marks["wrong"]]}


def _printable(text: str) -> str:
    """Return a student's text with � for each control character, which could harm the terminal."""
    return "".join(c if c.isprintable() else "�" for c in text)


def mark_folder(folder: Path, key: SigningKey) -> list[MarkedAnswer]:
    """Return a `MarkedAnswer` for each answer file in the folder and its subfolders.

    If a file cannot be marked, its `MarkedAnswer` gives the reason. Hidden files, and files whose
    ending is in `NOT_ANSWERS`, are skipped. ``key`` is the teacher's key. Raises UsageError if the
    folder is missing or contains only skipped files.
    """
    if not folder.is_dir():
        raise UsageError(
            f"There is no folder {folder}.",
            cause="a typing error in the path, or a file's path.",
            fix=f"ls -d {quoted(folder.parent)}/*",
        )
    files = sorted(
        f
        for f in folder.rglob("*")
        if not (f.is_dir() or f.suffix.lower() in NOT_ANSWERS)
        and not any(part.startswith(".") for part in f.relative_to(folder).parts)
    )
    if not files:
        raise UsageError(
            f"{folder} has no answers.",
            cause="another folder, or recordings only.",
            fix=f"ls -R {quoted(folder)}",
        )
    return [_marked(file, str(file.relative_to(folder)), key) for file in files]


def _marked(file: Path, name: str, key: SigningKey) -> MarkedAnswer:
    name = _printable(name)
    if not file.is_file():
        return MarkedAnswer(name, None, None, None, "it is not a regular file")
    try:
        answer = read_answer(file)
    except Heli3dofError as error:
        return MarkedAnswer(name, None, None, None, _printable(error.what))
    exercise = answer.exercise
    if (why := signature_problem(key, exercise)) is not None:
        return MarkedAnswer(name, answer, None, None, why)
    if other := {x for x in answer.flown_on if x != exercise.id}:
        flown = ", ".join(sorted(x or "another rig" for x in other))
        return MarkedAnswer(name, answer, None, None, f"the diagnosed recordings are of {flown}")
    truth = open_truth(key, exercise)
    return MarkedAnswer(name, answer, truth, mark(answer, truth), None)
