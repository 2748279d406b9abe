"""Mark answers: compare the claimed effects with those that are really hidden (the causes).

`mark_folder` marks the answers of a class: the files in a folder and its subfolders.


Names, sizes and stated confidence are marked. The mark of the confidence is the Brier score, the
sum of (c − o)² over all claimed effects and all causes. c is the stated confidence: 1 if none is
stated, 0 for a cause that is not claimed. o is 1 for a cause and 0 for any other effect. For the
claim `NONE`, o is 1 if nothing is hidden. The score is proper: in expectation, stating the true
probabilities gives the lowest sum. 0 is best.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from heli3dof.errors import Heli3dofError, UsageError, quoted
from heli3dof.exercise.answer import NONE, Answer, Claim, read_answer
from heli3dof.exercise.levels import right_names
from heli3dof.exercise.teacher_key import Truth, open_truth, signature_problem
from heli3dof.model.effects import term

if TYPE_CHECKING:
    from nacl.signing import SigningKey

NOT_ANSWERS = (".mcap", ".exercise")
"""Endings of the files in the folder that are not answers"""


@dataclass(frozen=True)
class SizeMark:
    """Comparison of the claimed and the true value of one parameter of a hidden effect.

    ``relative_error`` is |claimed − true| / |true − null value|; without the effect, the parameter
    has its null value. ``inside``: True if the claimed interval contains the true value, None if no
    interval was claimed.
    """

    cause: str
    parameter: str
    true: float
    claimed: float
    relative_error: float
    inside: bool | None


@dataclass(frozen=True)
class Mark:
    """The marks of one answer."""

    right: tuple[str, ...]
    """Hidden causes that the answer names"""
    wrong: tuple[str, ...]
    """Claimed causes that are not hidden"""
    missed: tuple[str, ...]
    """Hidden causes that the answer does not name"""
    confounded: tuple[str, ...]
    """Missed causes that the answer states to be confounded with a wrongly claimed one"""
    sizes: tuple[SizeMark, ...]
    brier: float | None
    """Brier score, 0 is best; None if the answer was not marked"""


def mark(answer: Answer, truth: Truth) -> Mark:
    """Return the marks of an answer to the hidden ``truth``; a claim matches at most one cause."""
    open_causes = {c.name: c for c in truth.causes}
    right: list[str] = []
    wrong: list[Claim] = []
    sizes: list[SizeMark] = []
    brier = 0.0
    for claim in (c for c in answer.causes if c.name == NONE or c.confidence != 0):
        found = next((n for n in open_causes if claim.name in right_names(n)), None)
        is_right = found is not None or (claim.name == NONE and not truth.causes)
        confidence = 1.0 if claim.confidence is None else claim.confidence
        brier += (confidence - is_right) ** 2
        if found is not None:
            cause = open_causes.pop(found)
            right.append(found)
            if claim.name == found:
                sizes += _sizes(claim, cause.values)
        elif not is_right:
            wrong.append(claim)
    confounded = [n for n in open_causes if any(right_names(n) & {*c.tied_with} for c in wrong)]
    brier += len(open_causes)
    return Mark(
        right=tuple(right),
        wrong=tuple(c.name for c in wrong),
        missed=tuple(open_causes),
        confounded=tuple(confounded),
        sizes=tuple(sizes),
        brier=brier,
    )


def _sizes(claim: Claim, truth: Mapping[str, float]) -> list[SizeMark]:
    marks = []
    effect = term(claim.name).effect
    null = {effect.parameters[0].name: effect.parameters[0].null}  # 0 for other parameters
    for parameter, true in truth.items():
        size = claim.parameters.get(parameter)
        if size is None:
            continue
        value, low, high = size.value, size.low, size.high
        if effect.name == "disturbance.periodic" and value < 0 and parameter == "torque_Nm":
            # A torque −τ sin(ωt) equals τ sin(ωt), shifted by half a period.
            value, low, high = (
                -value,
                None if high is None else -high,
                None if low is None else -low,
            )
        inside = None if low is None or high is None else low <= true <= high
        error = abs(value - true) / abs(true - null.get(parameter, 0.0))
        marks.append(SizeMark(claim.name, parameter, true, value, error, inside))
    return marks


@dataclass(frozen=True)
class MarkedAnswer:
    """An answer file and its marks, or the reason why the file has no marks."""

    file: str
    answer: Answer | None
    truth: Truth | None
    mark: Mark | None
    reason: str | None

    def document(self) -> dict[str, Any]:
        """Return the answer's marks (its grading) as a dict of JSON types.

        If the answer could not be marked, the dict has None and empty lists for the marks.
        """
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
