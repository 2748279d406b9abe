"""The live view of a flight: screen or line, when it appears, and its clean end."""

from __future__ import annotations

import io
import re
import time
from contextlib import AbstractContextManager

import pytest
from rich.console import Console

from heli3dof.cli import progress as module
from heli3dof.cli.output import Output
from heli3dof.cli.progress import progress
from heli3dof.experiment.control_loop.loop import Live
from heli3dof.rig.profile import default_profile
from tests.cli.running import Utf8
from tests.profiles import END_S

PROFILE = default_profile()
ESCAPES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


def flying(done: int = 500, total: int = 1000) -> Live:
    return Live(
        done=done, total=total, phase="flying", angle=(0.1, -0.2, 0.3), reference=(0.2, 0.0, 0.0),
        voltage=(7.5, -1.0), late=7, lost=2, lateness=0.0001, worst_lateness=0.002,
    )  # fmt: skip


def shown_by(out: Output, live: Live) -> AbstractContextManager[None]:
    return progress(out, live, "step", PROFILE)


def terminal_of(width: int, height: int = 24, **options: object) -> Output:
    out = Output()
    out.err = Console(
        file=Utf8(), force_terminal=True, width=width, height=height, legacy_windows=False,
        highlight=False,
        _environ={"TERM": "xterm", **options},
    )  # type: ignore[arg-type]  # fmt: skip
    return out


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Output:
    """An output whose stderr is a terminal of 120 × 23 cells, kept in memory: room for a line."""
    monkeypatch.setattr(module, "live_allowed", lambda: True)
    monkeypatch.setattr(module, "PER_SECOND", 100.0)
    return terminal_of(120, 23)


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
    with shown_by(terminal, live):
        wait_for(terminal, "step  flying  1 of 2 s  roll +5.7°  pitch −11.5°  yaw +17.2°  late 7")
        live.phase = "ramping down"
        wait_for(terminal, "step  ramping down")
    assert "\x1b[2K" in terminal.err.file.getvalue()[-40:]  # type: ignore[attr-defined]


def test_a_large_terminal_shows_references_limits_voltages_losses_and_how_to_stop(
    terminal: Output,
) -> None:
    large = terminal_of(80)
    with shown_by(large, flying()):
        wait_for(large, "heli3dof estop")
    lines = [line.rstrip() for line in shown(large).split("\n")]
    assert "roll     +5.7°   reference   +11.5°   limits −32 to 34°" in lines
    assert "front  +7.50 V   back  −1.00 V   limit ±24 V" in lines
    assert "7 periods late by over 1 ms, 2 lost; lateness 0.10 ms, at most 2.00 ms" in lines
    assert any("━" in line and "flying  1 of 2 s" in line for line in lines)


def test_a_terminal_without_braille_gets_the_line(
    terminal: Output, monkeypatch: pytest.MonkeyPatch
) -> None:
    ascii_only = terminal_of(80)
    monkeypatch.setattr(Utf8, "encoding", "ascii")
    with shown_by(ascii_only, flying()):
        wait_for(ascii_only, "roll +5.7deg")


def test_without_a_terminal_a_line_is_printed_now_and_then(
    terminal: Output, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "live_allowed", lambda: False)
    monkeypatch.setattr(module, "PRINT_EVERY_S", 0.01)
    with shown_by(terminal, flying()):
        wait_for(terminal, "step  flying  1 of 2 s")
    assert "\x1b" not in terminal.err.file.getvalue()  # type: ignore[attr-defined]


def test_a_terminal_of_80_cells_shows_the_whole_state(
    terminal: Output, monkeypatch: pytest.MonkeyPatch
) -> None:
    narrow = terminal_of(80, 23)
    with shown_by(narrow, flying()):
        wait_for(narrow, "late 7")


def test_a_warning_during_the_flight_has_its_own_line(terminal: Output) -> None:
    with shown_by(terminal, flying()):
        wait_for(terminal, "flying")
        terminal.warn("the rest angles are not known")
    (line,) = (each for each in shown(terminal).split("\n") if "Warning" in each)
    assert line.rpartition("\r")[2] == "Warning: the rest angles are not known"


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_closed_terminal_does_not_end_the_flight(terminal: Output) -> None:
    with shown_by(terminal, flying()):
        wait_for(terminal, "flying")
        terminal.err.file.close()
        time.sleep(0.05)


def test_quiet_shows_nothing(terminal: Output) -> None:
    terminal.quiet = True
    with shown_by(terminal, flying()):
        time.sleep(0.05)
    assert shown(terminal) == ""


def test_a_failure_in_the_flight_passes_through(terminal: Output) -> None:
    with pytest.raises(ValueError, match="of the flight"), shown_by(terminal, flying()):
        raise ValueError("of the flight")
