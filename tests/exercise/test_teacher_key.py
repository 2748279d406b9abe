"""The teacher's key: who can draw, open and read what."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from heli3dof.errors import RecordingError, UsageError
from heli3dof.exercise.teacher_key import (
    load_key,
    new_key,
    open_truth,
    others_can_read,
    seal,
)
from tests.exercise.making import EXERCISE, KEY, OTHER_KEY


def test_key_seed_and_level_determine_the_effects() -> None:
    again = seal(KEY, 7, 2)
    assert again.id == EXERCISE.id
    assert again.truth != EXERCISE.truth, "encryption is randomised"
    assert open_truth(KEY, again) == open_truth(KEY, EXERCISE)


def test_another_key_hides_other_effects_with_the_same_seeds() -> None:
    ours = [open_truth(KEY, seal(KEY, s, 3)) for s in range(5)]
    theirs = [open_truth(OTHER_KEY, seal(OTHER_KEY, s, 3)) for s in range(5)]
    assert all(a != b for a, b in zip(ours, theirs, strict=True))


def test_the_wrong_key_opens_nothing() -> None:
    with pytest.raises(RecordingError, match="another teacher's key"):
        open_truth(OTHER_KEY, EXERCISE)


def test_a_changed_exercise_is_found() -> None:
    for change in ({"level": 1}, {"truth": seal(KEY, 8, 2).truth}, {"rig": seal(KEY, 8, 2).rig}):
        with pytest.raises(RecordingError, match="changed after it was sealed"):
            open_truth(KEY, EXERCISE.model_copy(update=change))


@pytest.mark.skipif(os.name == "nt", reason="POSIX permissions")
def test_a_new_key_is_readable_by_its_owner_only_and_never_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "folder" / "teacher.key"
    new_key(path)
    assert path.stat().st_mode & 0o777 == 0o600
    assert not others_can_read(path)
    key = load_key(path)
    with pytest.raises(FileExistsError):
        new_key(path)
    assert load_key(path) == key
    path.chmod(0o644)
    assert others_can_read(path)


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"schema": "heli3dof.teacher_key/1"}', "[" * 10**5]
)
def test_a_file_that_is_no_key_is_an_error(tmp_path: Path, text: str) -> None:
    path = tmp_path / "k"
    path.write_text(text)
    with pytest.raises(RecordingError, match="is not a teacher's key"):
        load_key(path)
    with pytest.raises(UsageError, match="There is no teacher's key"):
        load_key(tmp_path / "missing")
