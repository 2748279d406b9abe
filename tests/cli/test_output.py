"""Names of files are printed as they are, even if they look like rich's markup or emoji codes."""

from __future__ import annotations

import io
import sys
from pathlib import Path

import pytest
from rich.table import Table

from heli3dof.cli.output import Output, stages
from tests.cli.running import heli3dof

NAME = "a :smile: [bold]b hide=yaw:abc"


def test_results_and_messages_contain_the_name(capsys: pytest.CaptureFixture[str]) -> None:
    out, table = Output(), Table()
    table.add_row(NAME)
    out.show(NAME, table)
    for printed in (out.note, out.warn, out.fail):
        printed(NAME)
    captured = capsys.readouterr()
    assert captured.out.count(NAME) == 2
    assert captured.err.count(NAME) == 3


def test_the_spinner_shows_the_name(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = io.StringIO()
    terminal.isatty = lambda: True  # type: ignore[method-assign]
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.delenv("NO_COLOR", raising=False)
    with Output().working(f"working on {NAME}"):
        pass
    with stages(Output()) as stage:
        stage(f"reading {NAME}")
    assert f"working on {NAME}" in terminal.getvalue()
    assert f"reading {NAME}" in terminal.getvalue()


def test_the_path_of_a_recording_exists(tmp_path: Path) -> None:
    path = tmp_path / f"{NAME}.mcap"
    flown = heli3dof(
        "run-step", "--roll", "5", "--settle", "2", "--duration", "1",
        "--device", "mock:?speed=max", "-o", path,
    )  # fmt: skip
    assert Path(flown.err.partition("Recording: ")[2].splitlines()[0]).is_file()
