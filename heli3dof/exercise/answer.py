"""A student's answer to an exercise: it claims which effects are hidden in the emulated rig.

The claims come from ``diagnose --json`` documents or from the student's own statements, such as
``stiffness.cable.yaw=0.1±0.01``.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from heli3dof.axes import ALIASES, AXES
from heli3dof.errors import RecordingError, UsageError, quoted
from heli3dof.exercise.levels import UNMODELLED
from heli3dof.model.effects import term
from heli3dof.rig.sealed_rig import Exercise, read_small

NONE = "none"
"""Name of the claim that the rig has no hidden effect"""
QUIET = ("nothing_found", "off_calibration")
"""Verdicts of a diagnosis that claim no hidden effect"""
Z95 = 1.96
"""Half-width of a 95 % interval in standard deviations"""


class _Part(BaseModel):
    model_config = ConfigDict(
        frozen=True, allow_inf_nan=False, serialize_by_alias=True, validate_by_name=True
    )


class Size(_Part):
    """The claimed value of an effect's parameter, and its 95 % interval (None: not stated)."""

    value: float
    low: float | None = None
    high: float | None = None


class Claim(_Part):
    """The claim that the rig has the hidden effect ``name``, e.g. ``stiffness.cable.yaw``.

    ``confidence``: probability that the claim is right (None: not stated). ``parameters``: name →
    claimed value. ``tied_with``: effects that the diagnosis reports as confounded with this one.
    """

    name: str = Field(max_length=200)
    confidence: float | None = Field(default=None, ge=0, le=1)
    parameters: dict[str, Size] = {}
    tied_with: tuple[str, ...] = ()

    def text(self) -> str:
        """Return the claim as a line of text: name, parameters with intervals, confidence."""
        line = self.name
        for name, p in self.parameters.items():
            interval = "" if p.low is None or p.high is None else f" ({p.low:.4g} … {p.high:.4g})"
            line += f", {name} = " + f"{p.value:.4g}{interval}".replace("-", "−")
        return line + ("" if self.confidence is None else f", confidence {self.confidence:.2f}")


class Answer(_Part):
    """The content of an answer file: the student's name, the exercise and the claims."""

    form: Literal["heli3dof.answer/1"] = Field(default="heli3dof.answer/1", alias="schema")
    name: str = Field(min_length=1, max_length=200)
    exercise: Exercise
    flown_on: tuple[str | None, ...] = ()
    """Ids of the exercises whose recordings were diagnosed (None: another rig)"""
    causes: tuple[Claim, ...] = Field(max_length=50)
    holdout_rmse_deg: dict[Literal["roll", "pitch", "yaw"], float | None] | None = None
    """Error of the diagnosis' model on held-out data, by axis"""

    def to_bytes(self) -> bytes:
        return self.model_dump_json(indent=2).encode() + b"\n"


def read_answer(path: Path) -> Answer:
    """Return the answer in a file.

    Raises UsageError for a missing file, RecordingError for a file that is not an answer.
    """
    try:
        return Answer.model_validate_json(read_small(path))
    except ValidationError as error:
        where = ".".join(str(key) for key in error.errors()[0]["loc"])
        raise RecordingError(
            f"{path.name} is not an answer{f' (wrong or missing: {where})' if where else ''}.",
            cause="another file, or it was edited by hand.",
            fix="heli3dof exercise submit writes an answer",
        ) from error


def read_diagnosis(path: Path) -> dict[str, Any]:
    """Return the ``diagnose --json`` document in ``path``; RecordingError if it is another file."""
    try:
        document = json.loads(read_small(path))
        if not str(document["schema"]).startswith("heli3dof.diagnosis/"):
            raise ValueError
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise RecordingError(
            f"{path} is not a diagnosis.",
            cause="exercise submit reads what heli3dof diagnose --json prints.",
            fix=f"heli3dof diagnose REC.mcap --json > {quoted(path.with_suffix('.json'))}",
        ) from error
    assert isinstance(document, dict)
    return document


def make_answer(
    name: str,
    exercise: Exercise,
    own: Sequence[Claim] = (),
    diagnoses: Mapping[str, Mapping[str, Any]] | None = None,
) -> Answer:
    """Return a student's answer with the claims ``own``; if there are none, those of ``diagnoses``.

    ``name`` is the student's name. ``diagnoses``: file name → content of ``diagnose --json``. Of
    several claims for the same effect, the first is kept. The claim `NONE` (no hidden effect) is
    kept only if it is the only one. The answer's model error on held-out data is that of the first
    diagnosis; None with claims ``own``. Raises UsageError if a diagnosis used recordings of another
    rig, RecordingError for an incomplete document.
    """
    claims: list[Claim] = []
    flown_on: list[str | None] = []
    documents = diagnoses or {}
    for file, document in documents.items():
        flown = document.get("about", {}).get("exercises", [])
        if set(flown) != {exercise.id}:
            other = flown[0] if len(set(flown)) == 1 else None
            raise UsageError(
                f"{file} is not a diagnosis of exercise {exercise.id} alone.",
                cause="its recordings were flown on another rig, or converted from another format."
                if other is None
                else f"it is a diagnosis of exercise {other}.",
                fix="diagnose recordings of heli3dof run --device 'mock:?exercise=FILE'"
                if other is None
                else f"--exercise with the sealed file of exercise {other}",
            )
        flown_on += flown
        try:
            claims += claims_of(document)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise RecordingError(
                f"{file} is not a complete diagnosis.",
                cause="it was edited by hand, or another version of heli3dof wrote it.",
                fix="heli3dof diagnose REC.mcap --json again",
            ) from error
    causes = list({c.name: c for c in reversed(own or claims)}.values())[::-1]
    if any(c.name != NONE for c in causes):
        causes = [c for c in causes if c.name != NONE]
    gain = {} if own else next(iter(documents.values()), {}).get("gain", {})
    return Answer(
        name=name,
        exercise=exercise,
        flown_on=tuple(flown_on),
        causes=tuple(causes),
        holdout_rmse_deg=gain.get("holdout_rmse_deg", {}).get("after"),
    )


def claims_of(document: Mapping[str, Any]) -> list[Claim]:
    """Return the claims of a diagnosis document: its ``findings`` and its unmodelled torques.

    The key ``leftover`` lists residual torques. Those that depend on a measured variable count as
    unmodelled torques. If there is no claim and the verdict is in `QUIET`, the function returns the
    claim `NONE`: no hidden effect.
    """
    claims = [_finding(f) for f in document["findings"]]
    claims += [
        Claim(name=f"{UNMODELLED}.{x['axis']}", confidence=x.get("confidence"))
        for x in document["leftover"]
        if x["depends_on"]
    ]
    if not claims and document["verdict"] in QUIET:
        return [Claim(name=NONE)]
    return claims


def _finding(finding: Mapping[str, Any]) -> Claim:
    effect, axis = str(finding["effect"]), finding.get("axis")
    sizes = {}
    for name, p in finding["parameters"].items():
        if p["value"] is not None:
            value, half = float(p["value"]), None if p["std"] is None else Z95 * float(p["std"])
            sizes[name] = _size(value, half)
    tied = tuple(finding["tied_with"])
    return Claim(
        name=effect if axis is None else f"{effect}.{axis}",
        confidence=finding["confidence"] / (1 + len(tied)),  # that one of them acts, shared equally
        parameters=sizes,
        tied_with=tied,
    )


def _size(value: float, half: float | None) -> Size:
    """Return a claimed value with its 95 % interval ``value`` ± ``half``; no interval if None."""
    if half is None:
        return Size(value=value)
    return Size(value=value, low=value - half, high=value + half)


_STATEMENT = re.compile(r"([^=]+)(?:=([^±=]+?)(?:(?:±|\+/?-)(.+))?)?")


def statements(texts: Sequence[str], confidence: Sequence[float]) -> list[Claim]:
    """Return claims from texts ``NAME``, ``NAME=VALUE`` or ``NAME=VALUE±HALF``.

    NAME is an effect, VALUE the value of its first parameter, VALUE ± HALF the 95 % interval.
    ``confidence`` has one value for each text, one value for all, or none. Raises UsageError for an
    unknown name, a text of another form, a wrong confidence, or a wrong number of confidences. It
    also raises UsageError for contradictory texts: two of the same name, or `NONE` with others.
    """
    if len(confidence) not in (0, 1, len(texts)) or (confidence and not texts):
        raise UsageError(
            f"Number of confidences: {len(confidence)}; of causes: {len(texts)}.",
            cause="each --cause needs its own --confidence, or one holds for all.",
            fix="--cause NAME=VALUE±HALF --confidence 0.9 for each cause",
        )
    for value in confidence:
        if not 0 <= value <= 1:
            raise UsageError(
                f"--confidence {value:g} is not a probability from 0 to 1.",
                cause="a value in percent." if 1 < value <= 100 else "a typing error.",
                fix=f"--confidence {value / 100 if 1 < value <= 100 else 0.9:g}",
            )
    each = [*confidence] if len(confidence) == len(texts) else [*confidence] * len(texts)
    claims = [_statement(text, each[i] if each else None) for i, text in enumerate(texts)]
    names = [claim.name for claim in claims]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise UsageError(
            f"--cause names {twice} twice.",
            cause="a typing error, or two values for one effect.",
            fix="remove one of the two",
        )
    if NONE in names and len(names) > 1:
        raise UsageError(
            f"--cause {NONE} contradicts the other causes.",
            cause=f"{NONE} claims that the rig has no hidden effect.",
            fix=f"give --cause {NONE} alone, or remove it",
        )
    return claims


def _statement(text: str, confidence: float | None) -> Claim:
    match = _STATEMENT.fullmatch(text.strip().replace("−", "-"))  # as heli3dof prints numbers
    try:
        if match is None:
            raise ValueError
        name, value, half = _effect_name(match[1].strip()), match[2], match[3]
        if half is not None and float(half) < 0:
            raise ValueError
        sizes = _claimed_sizes(name, value, half)
        return Claim(name=name, confidence=confidence, parameters=sizes)
    except ValueError as error:
        raise UsageError(
            f"--cause {text} is not NAME, NAME=VALUE or NAME=VALUE±HALF.",
            cause="a typing error; numbers have a decimal point and no unit, and HALF no sign.",
            fix="--cause stiffness.cable.yaw=0.1±0.01",
        ) from error


def _effect_name(text: str) -> str:
    """Return the name of a claim with roll and yaw for the axes elevation and travel.

    Raises UsageError if the catalogue has no such effect.
    """
    head, _, axis = text.rpartition(".")
    if head == UNMODELLED and ALIASES.get(axis, axis) in AXES:
        return f"{head}.{ALIASES.get(axis, axis)}"
    return text if text == NONE else term(text).name


def _claimed_sizes(name: str, value: str | None, half: str | None) -> dict[str, Size]:
    """Return the claimed size of an effect: {name of the effect's first parameter: size}.

    ``name``: the effect. ``value``: the claimed value of its first parameter, as text. If it is
    None, the result is {}. ``half``: half the width of the value's 95 % interval, as text.

    Raises UsageError if there is a value, but the claim is no effect with a parameter (`NONE`,
    `UNMODELLED`). Raises ValueError if a text is not a number.
    """
    if name == NONE or name.startswith(f"{UNMODELLED}."):
        if value is not None:
            raise UsageError(
                f"--cause {name} has no size.",
                cause="only an effect of the catalogue has a parameter.",
                fix=f"--cause {name}",
            )
        return {}
    parameters = term(name).effect.parameters
    if value is None:
        return {}
    return {parameters[0].name: _size(float(value), None if half is None else float(half))}
