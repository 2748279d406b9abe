"""The progress line of a flight: its content, when it appears, and its clean end."""

from __future__ import annotations

import io
import re
import time

import pytest
from rich.console import Console

from heli3dof.cli import progress as module
from heli3dof.cli.output import Output
from heli3dof.cli.progress import progress, state_text
from heli3dof.experiment.control_loop.loop import Live
from tests.profiles import END_S

ESCAPES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


def flying(done: int = 500, total: int = 1000) -> Live:
    return Live(done=done, total=total, phase="flying", angle=(0.1, -0.2, 0.3), late=7)


def test_the_state_is_phase_angles_in_degrees_and_late_periods() -> None:
    assert state_text(flying()) == "flying  roll   +5.7°  pitch  -11.5°  yaw   +17.2°  late 7"


def terminal_of(width: int, **options: object) -> Output:
    out = Output()
    out.err = Console(
        file=io.StringIO(), force_terminal=True, width=width, legacy_windows=False,
        _environ={"TERM": "xterm", **options},
    )  # type: ignore[arg-type]  # fmt: skip
    return out


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Output:
    """An output whose stderr is a terminal of 120 cells, kept in memory."""
    monkeypatch.setattr(module, "live_allowed", lambda: True)
    monkeypatch.setattr(module, "PER_SECOND", 100.0)
    return terminal_of(120)


def shown(out: Output) -> str:
    file = out.err.file
    assert isinstance(file, io.StringIO)
    return ESCAPES.sub("", file.getvalue())


def wait_for(out: Output, text: str) -> None:
    end = time.monotonic() + END_S
    while text not in shown(out):
        assert time.monotonic() < end, shown(out)[-500:]
        time.sleep(0.002)


def test_the_line_follows_the_flight_and_is_erased_at_its_end(terminal: Output) -> None:
    live = flying()
    with progress(terminal, live, "step"):
        wait_for(terminal, "step  flying  roll")
        live.phase = "ramping down"
        wait_for(terminal, "step  ramping down")
    assert "━" in shown(terminal)
    assert "\x1b[2K" in terminal.err.file.getvalue()[-40:]  # type: ignore[attr-defined]


def test_a_terminal_of_80_cells_shows_the_whole_state(
    terminal: Output, monkeypatch: pytest.MonkeyPatch
) -> None:
    narrow = terminal_of(80)
    with progress(narrow, flying(), "step"):
        wait_for(narrow, "late 7")


def test_a_warning_during_the_flight_has_its_own_line(terminal: Output) -> None:
    with progress(terminal, flying(), "step"):
        wait_for(terminal, "flying")
        terminal.warn("the rest angles are not known")
    (line,) = (each for each in shown(terminal).split("\n") if "Warning" in each)
    assert line.rpartition("\r")[2] == "Warning: the rest angles are not known"


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_closed_terminal_does_not_end_the_flight(terminal: Output) -> None:
    with progress(terminal, flying(), "step"):
        wait_for(terminal, "flying")
        terminal.err.file.close()
        time.sleep(0.05)


@pytest.mark.parametrize("kind", ["quiet", "dumb"])
def test_nothing_is_shown_where_no_display_is_allowed(terminal: Output, kind: str) -> None:
    out = terminal_of(120, TERM="dumb") if kind == "dumb" else terminal
    out.quiet = kind == "quiet"
    with progress(out, flying(), "step"):
        time.sleep(0.05)
    assert shown(out) == ""


def test_a_failure_in_the_flight_passes_through(terminal: Output) -> None:
    with pytest.raises(ValueError, match="of the flight"), progress(terminal, flying(), "step"):
        raise ValueError("of the flight")
