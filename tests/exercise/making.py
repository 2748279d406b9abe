"""Keys, exercises and answers for tests."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from heli3dof.exercise.answer import Answer, Claim, Size
from heli3dof.exercise.levels import Cause
from heli3dof.exercise.teacher_key import FORM, Truth, open_truth, seal
from heli3dof.rig.sealed_rig import Exercise

if TYPE_CHECKING:
    from nacl.signing import SigningKey

signing = pytest.importorskip("nacl.signing")
KEY = signing.SigningKey(bytes(range(32)))
OTHER_KEY = signing.SigningKey(bytes(range(1, 33)))
EXERCISE = seal(KEY, 7, 2)


def exercise_that(key: SigningKey, level: int, **wanted: object) -> Exercise:
    """The first exercise of a level, by seed, with this ``count`` of causes or this ``name``."""
    for seed in range(1000):
        exercise = seal(key, seed, level)
        names = [c.name for c in open_truth(key, exercise).causes]
        if wanted in ({"count": len(names)}, {"name": "".join(names[:1])}):
            return exercise
    raise AssertionError(wanted)


def truth(*causes: tuple[str, dict[str, float]]) -> Truth:
    return Truth(tuple(Cause(n, v) for n, v in causes), 0.0)


def answer(*causes: Claim, exercise: Exercise = EXERCISE) -> Answer:
    return Answer(name="Ada", exercise=exercise, causes=causes)


def claim(name: str, confidence: float | None = None, **sizes: tuple[float, float, float]) -> Claim:
    parameters = {n: Size(value=v, low=a, high=b) for n, (v, a, b) in sizes.items()}
    return Claim(name=name, confidence=confidence, parameters=parameters)


def diagnosis(exercise: Exercise, **changed: Any) -> dict[str, Any]:
    """A document of ``diagnose --json`` with the keys that an answer needs."""
    return {
        "schema": "heli3dof.diagnosis/1",
        "verdict": "explained",
        "findings": [
            {
                "effect": "friction.coulomb", "axis": "yaw", "confidence": 0.8,
                "parameters": {"torque_Nm": {"value": 0.03, "std": 0.001}},
                "tied_with": ["friction.viscous.yaw"],
            }
        ],
        "leftover": [{"axis": "roll", "depends_on": "yaw_rate", "confidence": 0.6}],
        "gain": {"holdout_rmse_deg": {"after": {"roll": 0.2, "pitch": 0.1, "yaw": None}}},
        "about": {"exercises": [exercise.id, exercise.id]},
        **changed,
    }  # fmt: skip


def written(folder: Path, exercise: Exercise, name: str = "rig.exercise") -> Path:
    path = folder / name
    path.write_bytes(exercise.to_bytes())
    return path


def key_file(folder: Path) -> Path:
    """`KEY` as the teacher's file."""
    path = folder / "teacher.key"
    path.touch(0o600)
    path.write_text(json.dumps({"schema": FORM, "private_key": bytes(KEY).hex()}))
    return path
