"""The sealed file: what it shows, and what happens to a damaged one."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from heli3dof.errors import RecordingError, UsageError
from heli3dof.exercise.teacher_key import open_truth, seal
from heli3dof.rig.sealed_rig import check_nacl, exercise_of, hidden_rig, read_exercise
from tests.exercise.making import EXERCISE, KEY, exercise_that, written


def test_the_file_is_as_long_for_nothing_as_for_two_effects() -> None:
    lengths = {len(exercise_that(KEY, 5, count=n).to_bytes()) for n in (0, 1, 2)}
    assert len(lengths) == 1


def test_the_emulated_rig_hides_what_the_truth_states(tmp_path: Path) -> None:
    rig = hidden_rig(read_exercise(written(tmp_path, EXERCISE)))
    truth = open_truth(KEY, EXERCISE)
    assert rig.hide == ",".join(c.text for c in truth.causes)
    assert rig.spread == truth.spread


def test_any_changed_byte_is_found(tmp_path: Path) -> None:
    whole = EXERCISE.to_bytes()
    for i in range(0, len(whole), 97):
        changed = bytearray(whole)
        changed[i] ^= 1
        path = tmp_path / "changed"
        path.write_bytes(changed)
        if not whole[i : i + 1].isspace():
            with pytest.raises(RecordingError):
                read_exercise(path)


def test_a_rig_of_another_exercise_is_found(tmp_path: Path) -> None:
    mixed = EXERCISE.model_copy(update={"rig": seal(KEY, 8, 1).rig})
    with pytest.raises(RecordingError, match="changed after it was sealed"):
        read_exercise(written(tmp_path, mixed))


def test_the_serial_number_names_the_exercise() -> None:
    assert exercise_of(EXERCISE.serial) == EXERCISE.id
    assert exercise_of("mock-0") is None
    assert len(EXERCISE.serial) <= 16, "the link protocol's limit"


def test_without_pynacl_the_error_names_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "nacl", None)
    with pytest.raises(UsageError) as caught:
        check_nacl()
    assert caught.value.fix == "pip install 'heli3dof[teaching]'"
