"""Show a flight's progress in one line of the terminal, ten times a second.

    step  flying  roll   +5.0°  pitch   -0.1°  yaw    +0.2°  late 0 ━━━━━━━━━──────── 0:12:30

A thread of the library rich draws the line from the control loop's state. Drawing takes 0.5 ms of
processor time (median; 90th percentile 1.0 ms). The thread yields Python's interpreter lock to the
loop within `heli3dof.experiment.control_loop.realtime_priority.SWITCH_S`.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from math import degrees
from typing import TYPE_CHECKING

from heli3dof.cli.output import Output, live_allowed
from heli3dof.cli.output_encoding import printable

if TYPE_CHECKING:
    from rich.console import RenderableType

    from heli3dof.experiment.control_loop.loop import Live

PER_SECOND = 10.0


@contextmanager
def progress(out: Output, live: Live, name: str) -> Iterator[None]:
    """Context manager: shows a flight's progress; nothing with ``--quiet`` or without a terminal.

    ``live``: the loop's progress; ``name``: the plan's name.
    """
    if out.quiet or not live_allowed() or out.err.is_dumb_terminal:
        yield
        return
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
    from rich.table import Column

    class FlightProgress(Progress):
        def get_renderable(self) -> RenderableType:
            state = printable(state_text(live), encoding)
            for task in self.task_ids:
                self.update(task, completed=live.done, total=live.total, state=state)
            return super().get_renderable()

    encoding = out.err.encoding
    text = TextColumn("{task.description}  {task.fields[state]}", markup=False)
    bar = BarColumn(bar_width=None, table_column=Column(ratio=1))
    display = FlightProgress(
        text, bar, TimeRemainingColumn(), console=out.err, expand=True, transient=True,
        refresh_per_second=PER_SECOND, redirect_stdout=False, redirect_stderr=False,
    )  # fmt: skip
    printed_name = printable("".join(c for c in name if c.isprintable()), encoding)
    display.add_task(printed_name, total=live.total, state="")
    # A terminal that was closed ends the display, not the flight.
    with suppress(OSError, ValueError):
        display.start()
    try:
        yield
    finally:
        with suppress(OSError, ValueError):
            display.stop()


def state_text(live: Live) -> str:
    """Return one line of text: flight phase, angles in degrees, number of late control periods."""
    roll, pitch, yaw = (degrees(angle) for angle in live.angle)
    return (
        f"{live.phase}  roll {roll:+6.1f}°  pitch {pitch:+6.1f}°  yaw {yaw:+7.1f}°"
        f"  late {live.late}"
    )
