"""The benchmark page is rendered from the measured figures, never typed."""

from __future__ import annotations

import importlib
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from heli3dof.cli import progress
from heli3dof.experiment.control_loop import realtime_priority
from tests.bench import __main__ as command
from tests.bench import page
from tests.bench.__main__ import topics
from tests.bench.bench_realtime import MEASURES, ratio
from tests.realtime.flight import WITHOUT


@pytest.mark.parametrize("path", sorted(page.pages(page.load())), ids=lambda p: p.name)
def test_a_page_of_results_is_rendered_from_the_figures(path: Path) -> None:
    made = page.pages(page.load())[path]
    assert path.read_text(encoding="utf-8") == made, "run: python -m tests.bench.page"


def test_no_row_of_the_page_was_measured_on_a_changed_tree() -> None:
    assert "-dirty" not in page.render(page.load())


@pytest.mark.parametrize("commit", ["", "0a1b2c3"])
def test_figures_are_kept_only_with_their_commit(
    commit: str,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    written: list[object] = []
    figure = {"what": "time", "value": "1 s", "bar": "≤ 2 s"}
    monkeypatch.setattr(command, "revision", lambda: commit)
    monkeypatch.setattr(command, "measure", lambda topic, at: {"figures": [figure]})
    monkeypatch.setattr(page, "STORE", tmp_path / "benchmarks.json")
    monkeypatch.setattr(page, "write", written.append)
    command.main(["cli"])
    printed = capsys.readouterr().err
    assert "time: 1 s  ≤ 2 s" in printed
    assert ("are not kept" in printed) == (not commit)
    assert page.STORE.exists() == bool(commit) == bool(written)


def test_a_new_file_is_a_change_of_the_tree(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(command, "ROOT", tmp_path)
    identity = ("-c", "user.name=a", "-c", "user.email=a@b")
    for words in (("init", "-q"), (*identity, "commit", "-q", "--allow-empty", "-m", "x")):
        subprocess.run(["git", *words], cwd=tmp_path, check=True)
    assert command.revision()
    (tmp_path / "bench_new.py").touch()
    assert command.revision() == ""


@pytest.mark.parametrize("topic", topics())
def test_every_bench_has_a_title_and_a_measurement(topic: str) -> None:
    bench = importlib.import_module(f"tests.bench.bench_{topic}")
    assert bench.TITLE
    assert callable(bench.measure)


def test_the_ratio_of_late_shares_has_an_interval_over_pairs() -> None:
    rng = np.random.default_rng(3)
    on = rng.exponential(1e-3, 40)
    point, low, high = ratio(on, 4 * on * rng.uniform(0.8, 1.2, 40))
    assert 3.5 < low < point < high < 4.5
    assert ratio(np.zeros(20), np.full(20, 0.01)) == (np.inf, np.inf, np.inf)
    assert np.isnan(ratio(np.zeros(20), np.zeros(20))).all()


def test_the_functions_that_the_bench_switches_off_exist() -> None:
    for name in MEASURES:
        switched = re.findall(r"^(realtime_priority|progress)\.(\w+) =", WITHOUT[name], re.M)
        assert switched
        modules = {"realtime_priority": realtime_priority, "progress": progress}
        assert all(callable(getattr(modules[module], each)) for module, each in switched)
