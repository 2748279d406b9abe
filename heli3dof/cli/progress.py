"""The line that a flight rewrites in the terminal, ten times a second.

    step ━━━━━━━━━━────────── flying  roll   +5.0°  pitch   -0.1°  yaw    +0.2°  late 0 0:12:30

    remaining = (now − since) · (total − done) / (done − first)       first: done at `since`

It is written by a thread beside the loop, whose interpreter and memory it shares, so it is plain
text: quick, and nothing is kept of it. rich's own Progress keeps the last 4096 texts that it
measured, and here every text is a new one: its table was filled and built anew for ten minutes.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from math import degrees
from typing import TYPE_CHECKING

from heli3dof.cli.output import Talk, live_allowed
from heli3dof.cli.output_encoding import carries, printable

if TYPE_CHECKING:
    from rich.console import Console, ConsoleRenderable

    from heli3dof.experiment.control_loop.loop import Live

REFRESH_S = 0.1
BAR = (5, 40)
"""Cells that the bar has at least (or it is left out) and at most"""
NARROW = 20
"""Cells for what is said, below which the name is left out"""
DONE, OPEN = "\x1b[32m", "\x1b[0m"
"""What stands before the bar's two parts: green, and no colour"""
HOME = "\r\x1b[K"
"""To the line's beginning, and nothing in it"""
UNKNOWN = "-:--:--"


@contextmanager
def progress(talk: Talk, live: Live, name: str) -> Iterator[None]:
    """The line, which looks at the loop; the loop never looks at it."""
    if talk.quiet or not live_allowed() or talk.err.is_dumb_terminal or talk.err.legacy_windows:
        yield
        return
    line = FlightLine(name, live, encoding=talk.err.encoding)
    done = threading.Event()

    def watch() -> None:
        # A terminal that has gone shows nothing, and the flight goes on.
        with suppress(OSError, ValueError):
            while not done.wait(REFRESH_S):
                _write(talk.err, HOME + line.text(talk.err.width))

    watcher = threading.Thread(target=watch, name="live view", daemon=True)
    with _room_for_others(talk.err):
        watcher.start()
        try:
            yield
        finally:
            done.set()
            watcher.join()


class FlightLine:
    """What the line says of a flight."""

    def __init__(
        self, name: str, live: Live, *, encoding: str = "utf-8",
        clock: Callable[[], float] = time.monotonic,
    ) -> None:  # fmt: skip
        from rich.cells import cell_len

        self._encoding = encoding
        self._name = printable("".join(c for c in name if c.isprintable()), encoding)
        self._name_cells = cell_len(self._name)
        self._live, self._clock = live, clock
        self._full, self._empty = "━─" if carries("━─", encoding) else "#-"
        self._first: tuple[float, int] | None = None
        """When it first saw the loop at work, and how far"""

    def text(self, width: int) -> str:
        """The line for a terminal of so many cells; it leaves the last one free."""
        live = self._live
        done, total = live.done, live.total
        roll, pitch, yaw = (degrees(a) for a in live.angle)
        said = printable(
            f" {live.phase}  roll {roll:+6.1f}°  pitch {pitch:+6.1f}°  yaw {yaw:+7.1f}°"
            f"  late {live.late} {self._remaining(done, total)}",
            self._encoding,
        )
        room = max(0, width - 1)
        least, most = BAR
        cells = min(most, room - self._name_cells - 1 - len(said))
        if cells < least:
            beside = room - self._name_cells
            return self._name + said[:beside] if beside > NARROW else said[1 : room + 1]
        full = cells * min(done, total) // total
        bar = f"{DONE}{self._full * full}{OPEN}{self._empty * (cells - full)}"
        return f"{self._name} {bar}{said}"

    def _remaining(self, done: int, total: int) -> str:
        """Hours, minutes and seconds until the plan is flown; the landing comes on top."""
        if not done:
            return UNKNOWN
        now = self._clock()
        since, first = self._first = self._first or (now, done)
        if done == first:
            return UNKNOWN
        left = round((now - since) * max(0, total - done) / (done - first))
        return f"{left // 3600}:{left // 60 % 60:02}:{left % 60:02}"


@contextmanager
def _room_for_others(console: Console) -> Iterator[None]:
    """What is printed meanwhile stands above the line; at the end, the line is gone."""
    from rich.console import RenderHook
    from rich.control import Control
    from rich.segment import ControlType

    class Above(RenderHook):
        def process_renderables(
            self, renderables: list[ConsoleRenderable]
        ) -> list[ConsoleRenderable]:
            erase = Control(ControlType.CARRIAGE_RETURN, (ControlType.ERASE_IN_LINE, 2))
            return [erase, *renderables]

    console.push_render_hook(Above())
    console.show_cursor(False)
    try:
        yield
    finally:
        console.pop_render_hook()
        with suppress(OSError, ValueError):
            _write(console, HOME)
            console.show_cursor(True)


def _write(console: Console, text: str) -> None:
    console.file.write(text)
    console.file.flush()
