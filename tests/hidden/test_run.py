"""The runner resumes, keeps results of different code apart, and records failures."""

from __future__ import annotations

from pathlib import Path

import pytest

from heli3dof.errors import UsageError
from tests.hidden import run as module
from tests.hidden.cases import CLASSES
from tests.hidden.run import Job, in_worker, key, lines, one, run, wanted
from tests.hidden.tools import TOOLS, Tool


def answer(recording):
    return {"verdict": "nothing_found", "findings": [], "leftover": []}


def failure(recording):
    raise ValueError("no convergence")


@pytest.fixture
def tools(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(TOOLS, "answer", Tool("a tool that finds nothing", answer, ()))
    monkeypatch.setitem(TOOLS, "failure", Tool("a tool that fails", failure, ()))


@pytest.mark.usefixtures("tools")
def test_finished_cases_are_not_run_again(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    job = [("run-step-nothing", 1000)]
    first = run(job, "answer", processes=1, folder=tmp_path)
    assert "0 of 1 are done" in capsys.readouterr().err
    second = run([*job, ("run-step-nothing", 1001)], "answer", processes=1, folder=tmp_path)
    assert "1 of 2 are done" in capsys.readouterr().err
    assert second["run-step-nothing-1000"] == first["run-step-nothing-1000"]
    assert set(second) == {"run-step-nothing-1000", "run-step-nothing-1001"}


@pytest.mark.usefixtures("tools")
def test_a_truncated_line_costs_only_its_own_case(tmp_path: Path) -> None:
    path = tmp_path / f"{key('answer')}.jsonl"
    path.write_text('{"case": "a"}\n{"case": "b", "gro', encoding="utf-8")
    run([("run-step-nothing", 1000)], "answer", processes=1, folder=tmp_path)
    assert [line["case"] for line in lines(path)] == ["a", "run-step-nothing-1000"]


@pytest.mark.usefixtures("tools")
def test_a_tool_that_fails_gives_a_line_with_its_error() -> None:
    line = one("run-step-nothing", 1000, TOOLS["failure"])
    assert line["error"] == "ValueError: no convergence"
    assert "document" not in line


def test_a_worker_with_other_code_is_refused() -> None:
    with pytest.raises(UsageError, match=r"other code than whole-0000"):
        in_worker(Job("run-step-nothing", 1000, TOOLS["whole"], "whole-0000"))


@pytest.mark.usefixtures("tools")
def test_a_worker_with_the_same_code_does_the_job(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module.resource, "setrlimit", lambda *limits: None)  # of this process
    line = in_worker(Job("run-step-nothing", 1000, TOOLS["answer"], key("answer")))
    assert line["document"] == answer(None)


def test_another_tool_or_changed_code_uses_another_file(monkeypatch: pytest.MonkeyPatch) -> None:
    assert key("whole") != key("quick")
    before = key("whole")
    monkeypatch.setattr(module, "FLIES", (*module.FLIES, "README.md"))
    assert key("whole") == before, "a README is not hashed"
    monkeypatch.setattr(module, "FLIES", (*module.FLIES, "tests/hidden/judge.py"))
    assert key("whole") != before


def test_a_part_of_the_cases_contains_every_class_from_the_start() -> None:
    jobs = wanted(1000, 0.1)
    assert {g for g, _ in jobs} == set(CLASSES)
    assert {g for g, _ in jobs[: len(jobs) // 2]} >= {g for g, c in CLASSES.items() if c.count > 40}
    assert all(1000 <= seed < 1000 + CLASSES[g].count for g, seed in jobs)
