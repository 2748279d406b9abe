"""Which recordings a batch works on."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest

from heli3dof.batch.sources import Source, find
from heli3dof.errors import RecordingError, UsageError


@pytest.fixture
def term(tmp_path: Path) -> Path:
    """A folder with three recordings in two folders, and files that are none."""
    for name in ("b.mcap", "a.mcap", "week/c.csv", "week/.hidden.mcap", "notes.md", ".git/d.mcap"):
        path = tmp_path / "term" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(name.encode())
    return tmp_path / "term"


def names(words: list[str]) -> list[str]:
    return [s.file_name for s in find(words)]


def test_a_folder_stands_for_its_recordings_and_logs_sorted_by_path(term: Path) -> None:
    assert names([str(term)]) == ["a.mcap", "b.mcap", "c.csv"]


def test_a_pattern_stands_for_the_files_that_match(term: Path) -> None:
    assert names([f"{term}/*.mcap"]) == ["a.mcap", "b.mcap"]
    assert names([f"{term}/**/c*"]) == ["c.csv"]


def test_a_list_names_a_recording_in_each_line(term: Path) -> None:
    (term / "list.txt").write_text(f"# first term\n{term}/b.mcap\n\n{term}/week\n")
    assert names([str(term / "list.txt")]) == ["b.mcap", "c.csv"]


def test_a_recording_that_is_named_twice_counts_once(term: Path) -> None:
    assert names([f"{term}/b.mcap", str(term)]) == ["b.mcap", "a.mcap", "c.csv"]


def test_of_an_earlier_batch_all_recordings_count_but_not_its_table(term: Path) -> None:
    for name in ("journal.jsonl", "results.csv", "recordings/flown.mcap", "added.mcap"):
        (term / "out" / name).parent.mkdir(parents=True, exist_ok=True)
        (term / "out" / name).touch()
    assert names([str(term / "out")]) == ["added.mcap", "flown.mcap"]


@pytest.mark.parametrize("word", ["empty", "none*.mcap", "missing.txt"])
def test_a_word_without_recordings_is_an_error(word: str, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(UsageError, match="There is no"):
        find([str(tmp_path / word)])


def test_a_named_file_that_is_missing_gets_its_row_later(tmp_path: Path) -> None:
    source = find([str(tmp_path / "missing.mcap")])[0]
    assert source.fingerprint() == ""
    with pytest.raises(RecordingError, match="There is no recording"):
        source.read()


def test_a_fingerprint_is_the_hash_of_the_content(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"abc")
    assert Source(str(tmp_path / "a.mcap")).fingerprint() == hashlib.sha256(b"abc").hexdigest()


def test_urls_of_any_file_system_are_found_and_read() -> None:
    fsspec = pytest.importorskip("fsspec")
    memory = fsspec.filesystem("memory")
    memory.pipe({"/lab/x.mcap": b"one", "/lab/y.mcap": b"two", "/lab/notes.md": b""})
    found = find(["memory://lab/*.mcap"])
    assert [s.name for s in found] == ["x", "y"]
    assert [s.read() for s in found] == [b"one", b"two"]
    assert found[0].fingerprint() != found[1].fingerprint()
    with pytest.raises(RecordingError, match=r"There is no file memory://lab/z\.mcap"):
        Source("memory://lab/z.mcap").read()


def test_an_unknown_kind_of_url_is_an_error() -> None:
    pytest.importorskip("fsspec")
    with pytest.raises(UsageError, match="cannot be opened"):
        find(["nothing://lab/*.mcap"])
