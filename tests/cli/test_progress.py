"""The line that a flight rewrites: what it says, that it fits, and that nothing is kept of it."""

from __future__ import annotations

import io
import re
import time
import tracemalloc

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.cells import cached_cell_len, cell_len
from rich.console import Console

from heli3dof.cli import progress as module
from heli3dof.cli.output import Talk
from heli3dof.cli.progress import FlightLine, progress
from heli3dof.experiment.control_loop.loop import Live
from tests.profiles import END_S

ESCAPES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


def flying(done: int = 500, total: int = 1000, **said: object) -> Live:
    live = Live(done=done, total=total, phase="flying")
    for key, value in said.items():
        setattr(live, key, value)
    return live


def plain(text: str) -> str:
    return ESCAPES.sub("", text)


def test_it_says_phase_angles_and_late_periods() -> None:
    live = flying(angle=(0.1, -0.2, 0.3), late=7)
    said = FlightLine("step", live).text(120)
    assert said.startswith("step ")
    assert "flying  roll   +5.7°  pitch  -11.5°  yaw   +17.2°  late 7" in said


@pytest.mark.parametrize(("done", "full"), [(0, 0), (250, 10), (500, 20), (1000, 40), (1003, 40)])
def test_the_bar_shows_how_far_it_is(done: int, full: int) -> None:
    text = FlightLine("step", flying(done)).text(200)
    assert (text.count("━"), text.count("─")) == (full, 40 - full)


def test_what_remains_is_told_by_the_pace_so_far() -> None:
    now = iter([10.0, 40.0])
    live = flying(100, 100_000)
    line = FlightLine("step", live, clock=lambda: next(now))
    assert line.text(120).endswith(" -:--:--"), "one look says nothing of the pace"
    live.done = 600  # 500 periods in 30 s: 99 400 more take 5964 s
    assert line.text(120).endswith(" 1:39:24")


@given(
    st.text(max_size=40), st.integers(1, 250), st.integers(0, 10**7), st.integers(1, 10**7),
    st.floats(-1e4, 1e4),
)  # fmt: skip
def test_it_never_fills_the_terminal_s_last_cell(
    name: str, width: int, done: int, total: int, angle: float
) -> None:
    live = flying(done, total, angle=(angle, -angle, angle))
    text = plain(FlightLine(name, live).text(width))
    assert cell_len(text) < width
    assert "\n" not in text


def test_a_narrow_terminal_has_no_bar_and_a_very_narrow_one_no_name() -> None:
    line = FlightLine("step", flying())
    assert line.text(60).startswith("step flying  roll")
    assert line.text(20).startswith("flying  roll")


def test_a_terminal_without_unicode_has_a_plain_bar() -> None:
    assert "#" * 20 + "-" * 20 in plain(FlightLine("step", flying(), encoding="ascii").text(200))


def test_a_line_leaves_nothing_behind_however_many_there_were() -> None:
    live = flying(total=10**6)
    line = FlightLine("step", live)
    measured = cached_cell_len.cache_info().misses

    def thousand() -> int:
        for k in range(1000):
            live.done, live.angle = live.done + 50, (k * 1e-3, -k * 1e-3, k * 1e-2)
            line.text(80)
        return tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    try:
        before = thousand()
        # Whatever else this process does meanwhile may keep some bytes, but not so many.
        assert thousand() - before < 20_000, "a kept text would be a hundred bytes a line"
    finally:
        tracemalloc.stop()
    assert cached_cell_len.cache_info().misses == measured, "rich keeps what it measures"


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Talk:
    """A talk whose errors go to a terminal of 100 cells, which is an `io.StringIO`."""
    monkeypatch.setattr(module, "live_allowed", lambda: True)
    monkeypatch.setattr(module, "REFRESH_S", 0.005)
    talk = Talk()
    talk.err = Console(
        file=io.StringIO(), force_terminal=True, width=100, legacy_windows=False,
        _environ={"TERM": "xterm"},
    )  # fmt: skip
    return talk


def shown(talk: Talk) -> str:
    file = talk.err.file
    assert isinstance(file, io.StringIO)
    return file.getvalue()


def until(talk: Talk, text: str, patience_s: float = END_S) -> None:
    last = time.monotonic() + patience_s
    while text not in shown(talk):
        assert time.monotonic() < last, shown(talk)[-500:]
        time.sleep(0.002)


def test_in_flight_it_is_rewritten_and_afterwards_it_is_gone(terminal: Talk) -> None:
    live = flying()
    with progress(terminal, live, "step"):
        until(terminal, "flying")
        live.phase = "ramping down"
        until(terminal, "ramping down")
    assert "\n" not in shown(terminal)
    assert shown(terminal).endswith("\r\x1b[K\x1b[?25h"), "an empty line, and the cursor is back"


def test_a_warning_meanwhile_stands_on_a_line_of_its_own(terminal: Talk) -> None:
    with progress(terminal, flying(), "step"):
        until(terminal, "flying")
        terminal.warn("the rest angles are not known")
    (line,) = (each for each in shown(terminal).split("\n") if "Warning" in each)
    assert plain(line.rpartition("\x1b[2K")[2]) == "Warning: the rest angles are not known"


def test_a_terminal_that_has_gone_does_not_end_the_flight(terminal: Talk) -> None:
    with progress(terminal, flying(), "step"):
        until(terminal, "flying")
        terminal.err.file.close()
        time.sleep(0.05)


@pytest.mark.parametrize("kind", ["quiet", "dumb"])
def test_where_nothing_may_move_nothing_is_written(terminal: Talk, kind: str) -> None:
    terminal.quiet = kind == "quiet"
    if kind == "dumb":
        terminal.err = Console(
            file=io.StringIO(), force_terminal=True, _environ={"TERM": "dumb"}, width=100
        )
    with progress(terminal, flying(), "step"):
        time.sleep(0.05)
    assert shown(terminal) == ""
