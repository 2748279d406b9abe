"""What a batch keeps on disk, and how it continues."""

from __future__ import annotations

import errno
import json
from pathlib import Path

import pytest

from heli3dof.batch.output_folder import JOURNAL, OutputFolder, journal_lines
from heli3dof.batch.task import Outcome
from heli3dof.errors import NoSpace, OutputExists, UsageError

OUTCOME = Outcome(
    "key-1", {"name": "a", "exit_code": 0}, {"schema": "x/1"}, {"models/a-1.json": b"model"}
)


def test_an_outcome_is_kept_with_its_document_and_files(tmp_path: Path) -> None:
    with OutputFolder(tmp_path / "out", resume=False) as out:
        out.add(OUTCOME, "a-1")
        assert out.is_done("key-1")
    assert json.loads((tmp_path / "out/documents/a-1.json").read_text()) == {"schema": "x/1"}
    assert (tmp_path / "out/models/a-1.json").read_bytes() == b"model"
    assert next(journal_lines(tmp_path / "out"))["row"]["document"] == "documents/a-1.json"


def test_results_are_never_overwritten_without_resume(tmp_path: Path) -> None:
    with OutputFolder(tmp_path, resume=False) as out:
        out.add(OUTCOME, "a-1")
    with pytest.raises(OutputExists, match="contains the results of a batch"):
        OutputFolder(tmp_path, resume=False)
    with OutputFolder(tmp_path, resume=True) as out:
        assert out.is_done("key-1")


def test_a_crash_is_tried_again(tmp_path: Path) -> None:
    with OutputFolder(tmp_path, resume=False) as out:
        out.add(Outcome("key-2", {"exit_code": 1}, {}, is_final=False), "b-2")
        assert not out.is_done("key-2")


@pytest.mark.parametrize("cut", range(1, 60, 7))
def test_a_line_that_was_cut_off_does_not_count(cut: int, tmp_path: Path) -> None:
    with OutputFolder(tmp_path, resume=False) as out:
        out.add(OUTCOME, "a-1")
        out.add(Outcome("key-2", {"exit_code": 0}, {}), "b-2")
    journal = tmp_path / JOURNAL
    journal.write_bytes(journal.read_bytes()[:-cut])
    with OutputFolder(tmp_path, resume=True) as out:
        assert out.is_done("key-1")
        assert not out.is_done("key-2") or cut == 1  # only the end of the line is missing
        out.add(Outcome("key-3", {"exit_code": 0}, {}), "c-3")
    with OutputFolder(tmp_path, resume=True) as out:
        assert out.is_done("key-1")
        assert out.is_done("key-3")


def test_two_batches_do_not_write_to_one_folder(tmp_path: Path) -> None:
    with (
        OutputFolder(tmp_path, resume=False),
        pytest.raises(UsageError, match="Another batch writes"),
        OutputFolder(tmp_path, resume=True),
    ):
        pass


def test_a_full_disk_keeps_what_was_done(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with OutputFolder(tmp_path, resume=False) as out:
        out.add(OUTCOME, "a-1")

        def full(stream: object, data: bytes) -> None:
            raise OSError(errno.ENOSPC, "No space left on device")

        monkeypatch.setattr("heli3dof.batch.output_folder.write_all", full)
        with pytest.raises(NoSpace, match="no space left"):
            out.add(Outcome("key-2", {"exit_code": 0}, {}), "b-2")
    monkeypatch.undo()
    with OutputFolder(tmp_path, resume=True) as out:
        assert out.is_done("key-1")
        assert not out.is_done("key-2")


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "out").touch()
    with pytest.raises(UsageError, match="is a file, not a folder"):
        OutputFolder(tmp_path / "out", resume=False)
