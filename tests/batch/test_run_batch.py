"""Whole batches: one row per recording, whatever happens to it or to the workers."""

from __future__ import annotations

import errno
from collections.abc import Generator, Iterable
from pathlib import Path
from typing import Any

import pytest

from heli3dof.batch.engines.processes import Processes
from heli3dof.batch.output_folder import OutputFolder, journal_lines
from heli3dof.batch.results_table import read_rows
from heli3dof.batch.run_batch import Batch, run_batch, tasks_of
from heli3dof.batch.sources import find
from heli3dof.batch.task import Task
from heli3dof.errors import NoSpace
from heli3dof.recording.atomic_write import write_all
from tests.batch.small import write_small


class InProcess:
    """Does the work here, in the order ``order``; ``remote``: as if the files were elsewhere."""

    def __init__(self, *, remote: bool = False, backwards: bool = False, most: int = 99) -> None:
        self.remote, self._backwards, self._most = remote, backwards, most
        self.did: list[Any] = []

    workers = 1

    def __enter__(self) -> InProcess:
        return self

    def __exit__(self, *error: object) -> None: ...

    def run(self, work: Any, items: Iterable[Any]) -> Generator[tuple[int, Any]]:
        numbered = list(enumerate(items))
        for done, (n, item) in enumerate(reversed(numbered) if self._backwards else numbered):
            if done == self._most:
                raise KeyboardInterrupt
            self.did.append(item)
            yield n, work(item)


@pytest.fixture
def term(tmp_path: Path) -> Path:
    """Six recordings: two rigs, one torn, one that is none."""
    folder = tmp_path / "term"
    folder.mkdir()
    for n in range(4):
        write_small(folder / f"flight-{n}.mcap", rig=f"K{n % 2 + 1}", roll_deg=5.0 + n)
    whole = (folder / "flight-0.mcap").read_bytes()
    (folder / "torn.mcap").write_bytes(whole[: len(whole) // 2])
    (folder / "wrong.mcap").write_bytes(b"no recording")
    return folder


def tasks(term: Path, where: str = "") -> list[Task]:
    return list(tasks_of("info", find([str(term)]), [{}], None, where))


def batch(term: Path, out: Path, engine: Any, *, resume: bool = False, where: str = "") -> Batch:
    with OutputFolder(out, resume=resume) as folder:
        return run_batch(tasks(term, where), folder, engine)


def test_every_recording_gets_a_row_and_failures_are_rows(term: Path, tmp_path: Path) -> None:
    done = batch(term, tmp_path / "out", InProcess())
    rows = read_rows(tmp_path / "out")
    assert [Path(r["recording"]).name for r in rows] == sorted(p.name for p in term.iterdir())
    codes = {r["name"]: r["exit_code"] for r in rows}
    assert codes["wrong"] == 5
    assert codes["flight-0"] == 0
    assert rows[0]["rig"] == "K1"
    assert (tmp_path / "out" / rows[0]["document"]).is_file()
    assert done.failed == sum(code != 0 for code in codes.values())


@pytest.mark.parametrize(
    "engine",
    [InProcess(backwards=True), InProcess(remote=True), Processes(1), Processes(2), Processes(4)],
    ids=["backwards", "contents sent", "1 process", "2 processes", "4 processes"],
)
def test_the_tables_are_the_same_bytes_on_every_engine(
    engine: Any, term: Path, tmp_path: Path
) -> None:
    batch(term, tmp_path / "one", InProcess())
    batch(term, tmp_path / "other", engine)
    for name in ("results.csv", "results.parquet"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "other" / name).read_bytes()


def test_resume_does_only_what_is_missing(term: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        batch(term, out, InProcess(most=3))
    assert len(read_rows(out)) == 3  # Ctrl-C leaves a table of what is done
    rest = InProcess()
    batch(term, out, rest, resume=True)
    assert len(rest.did) == len(tasks(term)) - 3
    again = InProcess()
    batch(term, out, again, resume=True)
    assert again.did == []
    assert len(read_rows(out)) == len(tasks(term))


def test_a_recording_that_changed_is_done_again(term: Path, tmp_path: Path) -> None:
    batch(term, tmp_path / "out", InProcess())
    (term / "flight-1.mcap").unlink()
    write_small(term / "flight-1.mcap", rig="K2", roll_deg=20.0)
    again = InProcess()
    batch(term, tmp_path / "out", again, resume=True)
    assert [task.name for task in again.did] == ["flight-1"]
    row = next(r for r in read_rows(tmp_path / "out") if r["name"] == "flight-1")
    assert row["roll_max_deg"] == pytest.approx(20.0, abs=0.1)


def test_only_recordings_that_meet_the_condition_get_a_row(term: Path, tmp_path: Path) -> None:
    done = batch(term, tmp_path / "out", InProcess(), where='rig=="K2"')
    rows = [r for r in read_rows(tmp_path / "out") if r["exit_code"] == 0]
    assert {r["name"] for r in rows} == {"flight-1", "flight-3"}
    assert done.left_out == 3  # two of K1, and the torn one, whose intact part is of K1


def test_two_copies_of_a_recording_are_worked_on_once(term: Path, tmp_path: Path) -> None:
    (term / "copy").mkdir()
    (term / "copy" / "flight-2.mcap").write_bytes((term / "flight-2.mcap").read_bytes())
    engine = InProcess()
    batch(term, tmp_path / "out", engine)
    assert [task.name for task in engine.did].count("flight-2") == 1
    rows = [r for r in read_rows(tmp_path / "out") if r["name"] == "flight-2"]
    assert len({r["recording"] for r in rows}) == 2


def test_the_journal_states_what_each_recording_cost(term: Path, tmp_path: Path) -> None:
    batch(term, tmp_path / "out", InProcess())
    for line in journal_lines(tmp_path / "out"):
        assert line["cost"]["wall_s"] > 0
        assert line["cost"]["sent_bytes"] > 0


def test_no_path_of_a_worker_reaches_the_results(term: Path, tmp_path: Path) -> None:
    batch(term, tmp_path / "out", InProcess(remote=True))
    for path in (tmp_path / "out").rglob("*.*"):
        if path.suffix in (".csv", ".json", ".jsonl"):
            assert "heli3dof-" not in path.read_text(encoding="utf-8"), path


def fill_disk_after(monkeypatch: pytest.MonkeyPatch, left: int) -> None:
    """Let every write fail after ``left`` bytes; the last one is written in part."""

    def write(stream: Any, data: bytes) -> None:
        nonlocal left
        fits, left = data[: max(0, left)], left - len(data)
        write_all(stream, fits)
        if left < 0:
            raise OSError(errno.ENOSPC, "No space left on device")

    for module in ("heli3dof.batch.output_folder", "heli3dof.recording.atomic_write"):
        monkeypatch.setattr(f"{module}.write_all", write)


@pytest.mark.parametrize("left", [0, 500, 4_000, 9_000, 14_000, 20_000, 26_000, 35_000])
def test_a_full_disk_ends_a_batch_that_resume_completes(
    left: int, term: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The disk is full within a document, a line of the journal or the table."""
    batch(term, tmp_path / "whole", InProcess())
    out = tmp_path / "out"
    with monkeypatch.context() as full:
        fill_disk_after(full, left)
        with pytest.raises(NoSpace, match="no space left"):
            batch(term, out, InProcess())
    kept = {line["key"] for line in journal_lines(out)}
    rest = InProcess()
    batch(term, out, rest, resume=True)
    assert len(rest.did) == len(tasks(term)) - len(kept)
    for name in ("results.csv", "results.parquet"):
        assert (out / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


def test_thirty_percent_of_unreadable_files_leave_the_others_their_rows(tmp_path: Path) -> None:
    folder, out = tmp_path / "term", tmp_path / "out"
    folder.mkdir()
    for n in range(10):
        write_small(folder / f"flight-{n}.mcap", roll_deg=5.0 + n)
    intact = {n: (folder / f"flight-{n}.mcap").read_bytes() for n in (2, 5, 8)}
    (folder / "flight-2.mcap").write_bytes(b"")
    (folder / "flight-5.mcap").write_bytes(bytes(5000))
    (folder / "flight-8.mcap").unlink()
    (folder / "flight-8.mcap").symlink_to(tmp_path / "a drive that is not mounted")
    done = batch(folder, out, Processes(2))
    assert (done.total, done.failed) == (10, 3)
    codes = {r["name"]: r["exit_code"] for r in read_rows(out)}
    assert [name for name, code in codes.items() if code] == ["flight-2", "flight-5", "flight-8"]
    again = InProcess()
    batch(folder, out, again, resume=True)
    assert not {t.name for t in again.did} - {"flight-8"}  # it may be readable by now
    (folder / "flight-8.mcap").unlink()
    for n, content in intact.items():
        (folder / f"flight-{n}.mcap").write_bytes(content)
    repaired = InProcess()
    batch(folder, out, repaired, resume=True)
    assert [t.name for t in repaired.did] == ["flight-2", "flight-5", "flight-8"]
    assert [r["exit_code"] for r in read_rows(out)] == [0] * 10
