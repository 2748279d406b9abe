"""``run --auto`` flies the plans that the diagnosis recommends, until it is settled.

The diagnoses are given here; tests/diagnosis tests that they are right.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from heli3dof.diagnosis import diagnose as diagnosing
from heli3dof.diagnosis.planning import next_experiment as asking
from heli3dof.diagnosis.result import NextExperiment
from heli3dof.recording.mcap_files.reader import read_recording
from tests.cli.running import heli3dof
from tests.flown import flown

LEVEL = "mock:?speed=max&start=level"
SHORT = """
name = "{name}"
description = "a step, short enough for a test"
[[segment]]
kind = "hold"
duration_s = 3.0
[[segment]]
kind = "step"
roll_deg = 8.0
duration_s = 9.0
"""


@pytest.fixture
def plans(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The path of a short plan, in the current folder."""
    path = tmp_path / "short.toml"
    path.write_text(SHORT.format(name="short"))
    monkeypatch.chdir(tmp_path)
    return path


@pytest.fixture(scope="module")
def whole() -> diagnosing.Diagnosis:
    """A real diagnosis, whose verdict the tests replace."""
    part = flown("rich", 18.0, device=LEVEL, seed=1250)
    with pytest.MonkeyPatch.context() as few:
        few.setattr(diagnosing, "QUICK", diagnosing.QUICK._replace(nulls=4, correction=2))
        return diagnosing.diagnose(part.between(6.0, 18.0), quick=True)


def answering(
    monkeypatch: pytest.MonkeyPatch, whole: diagnosing.Diagnosis, asks: list[str | None], plan: Path
) -> list[int]:
    """Let diagnosis k recommend the plan ``asks[k]``; return how many flights each was given."""
    seen: list[int] = []

    def diagnose(recordings: list[Any], **options: Any) -> diagnosing.Diagnosis:
        seen.append(len(recordings))
        names = tuple(r.name for r in recordings)
        open_ = asks[len(seen) - 1]
        return replace(whole, recordings=names, verdict="ambiguous" if open_ else "explained")

    def next_experiment(found: diagnosing.Diagnosis, **options: Any) -> NextExperiment | None:
        open_ = asks[len(seen) - 1]
        both = ("motor.lag", "motor.delay")
        return NextExperiment(open_, both, "they tie", 0.9) if open_ else None

    monkeypatch.setattr(diagnosing, "diagnose", diagnose)
    monkeypatch.setattr(asking, "next_experiment", next_experiment)
    return seen


def test_run_auto_flies_the_recommended_plans_until_settled(
    plans: Path, whole: diagnosing.Diagnosis, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = answering(monkeypatch, whole, [str(plans), None], plans)
    result = heli3dof("run", plans, "--auto", "--device", LEVEL, "-o", "auto", "--json")
    assert result.code == 0, result.err
    d = result.document
    assert seen == [1, 2]  # each diagnosis uses all flights so far
    assert d["ended"] == "settled"
    assert "Ended: settled." in result.err
    assert "Verdict" in result.err
    assert [Path(p).name for p in d["flights"]] == ["1-short.mcap", "2-short.mcap"]
    for path in d["flights"]:
        assert read_recording(path).meta["outcome"] == "completed"
    assert d["diagnosis"]["schema"] == "heli3dof.diagnosis/1"
    page = Path(d["report"]).read_text(encoding="utf-8")
    assert "Verdict" in page
    assert "1-short" in page
    assert "2-short" in page


def test_run_auto_ends_if_the_emulated_rig_repeats_a_flight(
    plans: Path, whole: diagnosing.Diagnosis, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = answering(monkeypatch, whole, [str(plans)] * 9, plans)
    result = heli3dof("run", plans, "--auto", "--device", f"{LEVEL}&seed=1", "-o", "auto", "--json")
    assert result.code == 0, result.err
    assert seen == [1]
    assert "fixed seed" in result.document["ended"]
    assert len(result.document["flights"]) == 1


def test_run_auto_stops_before_the_budget_is_exceeded(
    plans: Path, whole: diagnosing.Diagnosis, monkeypatch: pytest.MonkeyPatch
) -> None:
    answering(monkeypatch, whole, [str(plans)] * 9, plans)
    words = (
        "run",
        plans,
        "--auto",
        "--budget-min",
        "0.5",
        "--device",
        LEVEL,
        "-o",
        "auto",
        "--json",
    )
    d = heli3dof(*words).document
    assert len(d["flights"]) == 2  # 2 × 12 s in 30 s
    assert d["ended"].startswith("out of budget")
    assert d["diagnosis"]["next_experiment"]["separates"] == ["motor.lag", "motor.delay"]


def test_a_budget_below_the_first_plan_and_a_folder_in_use_are_refused(plans: Path) -> None:
    short = heli3dof("run", plans, "--auto", "--budget-min", "0.15", "--device", LEVEL, "-o", "a")
    assert short.code == 2
    assert "more than the budget" in short.err
    again = heli3dof("run", plans, "--auto", "--device", LEVEL, "-o", plans.parent)
    assert again.code == 2
    assert "exists" in again.err
    assert heli3dof("run").code == 2


def test_a_dry_run_prints_the_plan_and_flies_nothing(plans: Path) -> None:
    result = heli3dof("run", plans, "--auto", "--dry-run", "--device", LEVEL)
    assert result.code == 0
    assert "Automatic: short first" in result.out
    assert list(plans.parent.iterdir()) == [plans]
