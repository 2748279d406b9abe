"""``heli3dof batch``."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from heli3dof.batch.results_table import read_rows
from tests.batch.small import write_small
from tests.cli.running import heli3dof


@pytest.fixture
def term(tmp_path: Path) -> Path:
    folder = tmp_path / "term"
    folder.mkdir()
    for n in range(3):
        write_small(folder / f"flight-{n}.mcap", rig=f"K{n}", roll_deg=5.0 + n)
    return folder


def test_a_batch_writes_a_table_and_states_what_it_did(term: Path, tmp_path: Path) -> None:
    (term / "wrong.mcap").write_bytes(b"no recording")
    done = heli3dof("batch", "info", term, "-o", tmp_path / "out", "--workers", 1, "--json")
    assert done.code == 0
    assert done.document["recordings"] == 4
    assert done.document["failed"] == 1
    assert Path(done.document["tables"][0]).name == "results.parquet"
    assert len(read_rows(tmp_path / "out")) == 4


def test_it_fails_if_every_recording_fails(tmp_path: Path) -> None:
    (tmp_path / "wrong.mcap").write_bytes(b"no recording")
    done = heli3dof("batch", "info", tmp_path / "wrong.mcap", "-o", tmp_path / "out")
    assert done.code == 5
    assert "0 of 1 recordings done, 1 failed" in done.out
    assert "The first failure: " in done.out
    assert "wrong.mcap is not an MCAP recording" in done.out


def test_results_are_continued_only_on_request(term: Path, tmp_path: Path) -> None:
    command = ("batch", "info", term, "-o", tmp_path / "out", "--workers", 1)
    assert heli3dof(*command).code == 0
    refused = heli3dof(*command)
    assert refused.code == 2
    assert "--resume" in refused.err
    continued = heli3dof(*command, "--resume", "--json")
    assert continued.document["kept"] == 3


def test_mistakes_are_found_before_any_work(term: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    for words in (
        ("info", term, "--where", "rig=K1"),
        ("identify", term, "--method", "gray"),
        ("identify", term, "--terms", "+friction.nothing"),
        ("compare", term, "--model", "hoover"),
        ("info", term, "--cluster", "tcp://127.0.0.1:1", "--workers", 2),
        ("info", tmp_path / "nothing*.mcap"),
        ("info", tmp_path / "nofolder"),
    ):
        failed = heli3dof("batch", *words, "-o", out)
        assert failed.code == 2, words
        assert not (out / "results.csv").exists()


def test_results_do_not_mix_with_recordings(term: Path) -> None:
    before = sorted(term.iterdir())
    for words in ((term,), (term / "flight-0.mcap",)):
        failed = heli3dof("batch", "info", *words, "-o", term)
        assert (failed.code, sorted(term.iterdir())) == (2, before)
        assert "is the folder of the recordings" in failed.err


def test_a_missing_recording_has_the_exit_code_of_an_unusable_one(term: Path) -> None:
    out = term.parent / "out"
    words = (term / "flight-0.mcap", term / "flight-9.mcap")
    assert heli3dof("batch", "info", *words, "-o", out, "--workers", 1).code == 0
    assert [row["exit_code"] for row in read_rows(out)] == [0, 5]


def test_a_comparison_has_the_errors_of_each_model(tmp_path: Path) -> None:
    from heli3dof_recordings import references

    path = next(r.path for r in references() if r.use == "compare")
    done = heli3dof("batch", "compare", path, "-o", tmp_path / "out", "--workers", 1)
    assert done.code == 0
    row = read_rows(tmp_path / "out")[0]
    assert row["hover_rmse_1_roll_deg"] > 0
    assert "hover" in row["verdict"]


def test_ctrl_c_leaves_a_table_of_what_is_done(term: Path, tmp_path: Path) -> None:
    for n in range(3, 60):
        write_small(term / f"flight-{n}.mcap", roll_deg=5.0 + n / 10)
    out = tmp_path / "out"
    command = [sys.executable, "-m", "heli3dof", "batch", "info", term, "-o", out, "--workers", "1"]
    running = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    journal = out / "journal.jsonl"
    until = time.monotonic() + 120
    while not (journal.exists() and journal.read_bytes().count(b"\n") > 2):
        assert time.monotonic() < until
        time.sleep(0.05)
    os.kill(running.pid, signal.SIGINT)
    _, err = running.communicate(timeout=60)
    assert running.returncode == 130, err
    done = len(read_rows(out))
    assert 3 <= done < 60
    lines = journal.read_text(encoding="utf-8").splitlines()
    assert all(json.loads(line)["final"] for line in lines)
    again = heli3dof("batch", "info", term, "-o", out, "--workers", 1, "--resume", "--json")
    assert again.document["kept"] == done
    assert len(read_rows(out)) == 60
