"""``heli3dof monitor``: shows angles, rates, voltages, lateness and flags live, without arming.

If another process uses the rig, that process supplies the readings. Otherwise this command opens
the rig and reads it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from heli3dof.cli.options import AnyDevice, ProfileFile, device_or_default, rig_profile
from heli3dof.cli.output import INTERRUPTED, Output, live_allowed, verb

if TYPE_CHECKING:
    from heli3dof.cli.monitor_state import MonitorState
    from heli3dof.rig.session.client import Running

PERIOD_S = 0.1
READINGS_PER_LINE = 10
"""Number of readings per printed line if there is no terminal"""


def register(app: typer.Typer) -> None:
    app.command("monitor", rich_help_panel="Plans and rigs")(monitor)


@verb
def monitor(
    out: Output,
    device: AnyDevice = None,
    seconds: Annotated[
        float | None, typer.Option("--seconds", min=0, help="Duration; default: until Ctrl-C.")
    ] = None,
    profile: ProfileFile = None,
) -> None:
    """Show angles, rates, voltages, lateness and flags ten times a second. Moves nothing.

    Example: heli3dof monitor --seconds 30
    """
    from heli3dof.cli.monitor_state import MonitorState

    state = MonitorState()
    with _source(out, device, profile) as (read, about):
        interrupted = False
        try:
            _show_readings(out, read, state, seconds)
        except KeyboardInterrupt:
            interrupted = True
    out.emit({"schema": "heli3dof.monitor/1", **about, **state.document()})
    if interrupted:
        raise typer.Exit(INTERRUPTED)


@contextmanager
def _source(
    out: Output, device: str | None, profile_file: Path | None
) -> Iterator[tuple[Callable[[], dict[str, Any] | None], dict[str, Any]]]:
    """Context manager: yield the pair ``read, about``.

    ``read`` is a function that returns the rig's next reading. ``about`` is a dict for the JSON
    document: the device's URL, and the id and the activity of the other process that uses the rig.
    If no other process uses the rig, id and activity are None.

    If another process uses the rig, ``read`` requests each reading from that process. It returns
    None once that process has ended. If no other process uses the rig, the context manager opens
    the rig, and closes it at the end of the ``with`` block.
    """
    from heli3dof.rig.session.client import lives, running, state
    from heli3dof.rig.session.open_exclusive import open_rig, state_of

    session = _session(device, running(device))
    if session is not None:
        out.note(f"{session.device}, in use by pid {session.pid} ({session.doing})")
        about = {"device": session.device, "pid": session.pid, "doing": session.doing}

        def read_session() -> dict[str, Any] | None:
            reported = state(session)
            # A process that does not answer may recover: return empty readings until it ends.
            return {} if reported is None and lives(session) else reported

        yield read_session, about
        return
    url = device_or_default(out, device)
    profile = rig_profile(profile_file)
    with open_rig(url, profile) as rig:
        if rig.rest.note:
            out.warn(rig.rest.note)
        out.note(f"{url}: {rig.identity.model}, serial {rig.identity.serial}; not armed")

        def read_rig() -> dict[str, Any]:
            start = time.monotonic()
            rig.read()
            return {**state_of(rig, profile), "answer_s": time.monotonic() - start}

        yield read_rig, {"device": url, "pid": None, "doing": None}


def _session(device: str | None, sessions: list[Running]) -> Running | None:
    """Return the newest of ``sessions`` (processes that use the device); None if there is none.

    ``device``: URL, or None for any device. If the URL of an emulated rig contains options, the
    function considers only the sessions whose URL contains all these options.
    """
    from heli3dof.rig.drivers import is_private
    from heli3dof.rig.url import parse_url

    if device is not None and is_private(device):
        wanted = parse_url(device).options.items()
        sessions = [s for s in sessions if wanted <= parse_url(s.device).options.items()]
    return max(sessions, key=lambda s: s.since_utc, default=None)


def _show_readings(
    out: Output,
    read: Callable[[], dict[str, Any] | None],
    state: MonitorState,
    seconds: float | None,
) -> None:
    from heli3dof.rig.clock import wait_until

    due = time.monotonic()
    end = None if seconds is None else due + seconds
    with _display(out, state) as show:
        while True:
            reading = read()
            if reading is None:
                out.note("The session has ended.")
                return
            state.add(reading)
            show()
            due = max(due + PERIOD_S, time.monotonic())
            if end is not None and due > end:
                return
            wait_until(due)


@contextmanager
def _display(out: Output, state: MonitorState) -> Iterator[Callable[[], None]]:
    """Context manager: yield a function that displays the monitored ``state``.

    A terminal shows moving traces, a file gets lines of text, and ``--quiet`` shows nothing.
    """
    if out.quiet or not live_allowed():

        def line() -> None:
            if state.readings % READINGS_PER_LINE == 1:
                out.note(state.line())

        yield line
        return
    from rich.live import Live

    with Live(console=out.err, auto_refresh=False, transient=False) as live:
        yield lambda: live.update(state.screen(out.err), refresh=True)
