"""Show a flight live: angles against references, voltages, limits, lateness, time left.

A terminal of at least 80 × 24 characters shows moving traces; a smaller one shows a line of text.
Without a terminal, a line is printed every `PRINT_EVERY_S` seconds.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Any

from heli3dof.axes import AXES, MOTORS
from heli3dof.cli.output import Output, live_allowed
from heli3dof.cli.output_encoding import printable
from heli3dof.cli.traces import PER_SECOND, Traces, fits
from heli3dof.errors import minus

if TYPE_CHECKING:
    from rich.console import Console, RenderableType

    from heli3dof.experiment.control_loop.loop import Live
    from heli3dof.experiment.fly import Flight
    from heli3dof.experiment.plan import Plan
    from heli3dof.rig.profile import Profile

PRINT_EVERY_S = 10.0
HOW_TO_STOP = "Ctrl-C ramps the motors to zero; heli3dof estop stops them at once"


def fly_with_progress(
    out: Output, plan: Plan, profile: Profile, device: str, seed: int, output: Path, **more: Any
) -> Flight:
    """Fly a plan with `fly_plan`, show progress and warnings on ``out``, and return the flight.

    ``more``: further arguments of `fly_plan`.
    """
    from heli3dof.experiment.control_loop.loop import Live
    from heli3dof.experiment.fly import fly_plan

    live = Live()
    with progress(out, live, plan.name, profile):
        return fly_plan(
            plan, profile=profile, device=device, seed=seed, output=output, live=live,
            warn=out.warn, **more,
        )  # fmt: skip


@contextmanager
def progress(out: Output, live: Live, name: str, profile: Profile) -> Iterator[None]:
    """Context manager: shows a flight's progress. Shows nothing if ``out.quiet``.

    ``live``: the control loop's state; ``name``: the plan's name; ``profile``: the rig's profile.
    """
    if out.quiet:
        yield
        return
    printed_name = printable("".join(c for c in name if c.isprintable()), out.err.encoding)
    view = FlightView(out.err, live, printed_name, profile)
    if not live_allowed() or out.err.is_dumb_terminal:
        with _printing(out, view):
            yield
        return
    from rich.live import Live as Display

    display = Display(
        get_renderable=view.render, console=out.err, refresh_per_second=PER_SECOND, transient=True,
        redirect_stdout=False, redirect_stderr=False,
    )  # fmt: skip
    # A terminal that was closed ends the display, not the flight.
    with suppress(OSError, ValueError):
        display.start()
    try:
        yield
    finally:
        with suppress(OSError, ValueError):
            display.stop()


@contextmanager
def _printing(out: Output, view: FlightView) -> Iterator[None]:
    """Context manager: prints `FlightView.line` every `PRINT_EVERY_S` seconds."""
    ended = threading.Event()

    def print_lines() -> None:
        with suppress(OSError, ValueError):
            while not ended.wait(PRINT_EVERY_S):
                # Not by rich, which would load modules in mid-flight.
                print(view.line(), file=out.err.file, flush=True)

    thread = threading.Thread(target=print_lines, name="progress", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


class FlightView:
    """The screen or line that shows a flight live; it collects the traces of the angles."""

    def __init__(self, console: Console, live: Live, name: str, profile: Profile) -> None:
        self.console, self.live, self.name, self.profile = console, live, name, profile
        self.traces = Traces()

    def render(self) -> RenderableType:
        """Return the present screen, or a line if the terminal is too small for it."""
        from rich.cells import cached_cell_len
        from rich.console import Group
        from rich.text import Text

        live = self.live
        now_s = live.done * self.profile.dt
        angle = [degrees(a) for a in live.angle]
        reference = [degrees(a) for a in live.reference]
        # rich caches the width of every text drawn; new texts in each frame would fill the cache.
        cached_cell_len.cache_clear()
        if live.done:
            self.traces.add(now_s, angle, reference)
        if not fits(self.console):
            return Text(self.line(), no_wrap=True, overflow="ellipsis")
        width = self.console.width
        late = (
            f"{live.late} periods late by over 1 ms, {live.lost} lost; "
            f"lateness {live.lateness * 1e3:.2f} ms, at most {live.worst_lateness * 1e3:.2f} ms"
        )
        return Group(
            self._bar(width),
            *self.traces.draw(self._heads(angle, reference), width),
            Text(minus(self._voltages())),
            Text(late),
            Text(HOW_TO_STOP, "bold"),
        )

    def line(self) -> str:
        """Return one line: plan, phase, time, angles (°) and the number of late periods."""
        roll, pitch, yaw = (degrees(angle) for angle in self.live.angle)
        angles = minus(f"roll {roll:+.1f}°  pitch {pitch:+.1f}°  yaw {yaw:+.1f}°")
        return printable(
            f"{self.name}  {self.live.phase}  {self._time()}  {angles}  late {self.live.late}",
            self.console.encoding,
        )

    def _time(self) -> str:
        """Return as text the seconds flown so far, and the duration of the plan."""
        done, total = (n * self.profile.dt for n in (self.live.done, self.live.total))
        return f"{done:.0f} of {total:.0f} s"

    def _bar(self, width: int) -> RenderableType:
        from rich.text import Text

        text = f"{self.name}  {self.live.phase}  {self._time()}  "
        room = max(10, width - len(text))
        done = round(room * self.live.done / self.live.total)
        return Text.assemble(text, ("━" * done, "green"), ("─" * (room - done), "dim"))

    def _heads(self, angle: Sequence[float], reference: Sequence[float]) -> list[str]:
        """Return a line for each axis: angle, reference and safety limits (°)."""
        limits = self.profile.limits
        envelope = (
            f"{limits.roll_min_deg:g} to {limits.roll_max_deg:g}°",
            f"±{limits.pitch_max_deg:g}°", f"±{limits.yaw_max_deg:g}°",
        )  # fmt: skip
        return [
            f"{axis:<6}{a:+7.1f}°   reference {r:+7.1f}°   limits {e}"
            for axis, a, r, e in zip(AXES, angle, reference, envelope, strict=True)
        ]

    def _voltages(self) -> str:
        each = [f"{m} {v:+6.2f} V" for m, v in zip(MOTORS, self.live.voltage, strict=True)]
        return f"{'   '.join(each)}   limit ±{self.profile.motor.v_max:g} V"
