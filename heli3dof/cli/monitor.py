"""``monitor``: live angles, rates, volts, lateness and flags. Never arms.

A rig that a session holds is watched through that session; one that is free is opened and read.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from heli3dof.cli.device_option import AnyDevice, the_rig
from heli3dof.cli.options import AsJson, ProfileFile, Quiet
from heli3dof.cli.output import INTERRUPTED, Talk, live_allowed, verb

if TYPE_CHECKING:
    from heli3dof.cli.monitor_state import View
    from heli3dof.rig.session.client import Running

PERIOD_S = 0.1
LINE_EVERY = 10
"""Readings a line, where nobody watches a screen"""


def register(app: typer.Typer) -> None:
    app.command("monitor")(monitor)


@verb
def monitor(
    device: AnyDevice = None,
    seconds: Annotated[
        float | None, typer.Option("--seconds", min=0, help="End after so long; default: Ctrl-C.")
    ] = None,
    profile: ProfileFile = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Watch a rig: angles, rates, volts, lateness, flags, ten times a second. Moves nothing."""
    from heli3dof.cli.monitor_state import View

    talk = Talk(as_json=as_json, quiet=quiet)
    view = View()
    with ExitStack() as stack:
        source, about = _source(talk, device, profile, stack)
        interrupted = False
        try:
            _watch(talk, source, view, seconds)
        except KeyboardInterrupt:
            interrupted = True
    talk.emit({"schema": "heli3dof.monitor/1", **about, **view.document()})
    if interrupted:
        raise typer.Exit(INTERRUPTED)


def _source(
    talk: Talk, device: str | None, profile_file: Path | None, stack: ExitStack
) -> tuple[Callable[[], dict[str, Any] | None], dict[str, Any]]:
    """What to read from; None from it: there is no more."""
    from heli3dof.rig.profile import default_profile, load_profile
    from heli3dof.rig.session.client import lives, running, state
    from heli3dof.rig.session.open_exclusive import hold, state_of

    session = _session(device, running(device))
    if session is not None:
        talk.note(f"{session.device}: watching what pid {session.pid} runs ({session.doing})")
        about = {"device": session.device, "pid": session.pid, "doing": session.doing}

        def ask() -> dict[str, Any] | None:
            told = state(session)
            # One that hangs may go on; it is watched until it is gone.
            return {} if told is None and lives(session) else told

        return ask, about
    url = the_rig(talk, device)
    rig_profile = load_profile(profile_file) if profile_file else default_profile()
    rig = stack.enter_context(hold(url, rig_profile))
    if rig.rest.note:
        talk.warn(rig.rest.note)
    talk.note(f"{url}: {rig.identity.model}, serial {rig.identity.serial}; not armed")

    def read() -> dict[str, Any]:
        asked = time.monotonic()
        rig.read()
        return {**state_of(rig, rig_profile), "answer_s": time.monotonic() - asked}

    return read, {"device": url, "pid": None, "doing": None}


def _session(device: str | None, found: list[Running]) -> Running | None:
    """The newest that flies what was asked for: of several emulated rigs, that one.

    A URL with options means a rig with these options: an emulated one is made of them.
    """
    from heli3dof.rig.drivers import is_private
    from heli3dof.rig.url import parse_url

    if device is not None and is_private(device):
        wanted = parse_url(device).options.items()
        found = [s for s in found if wanted <= parse_url(s.device).options.items()]
    return max(found, key=lambda s: s.since_utc, default=None)


def _watch(
    talk: Talk,
    source: Callable[[], dict[str, Any] | None],
    view: View,
    seconds: float | None,
) -> None:
    from heli3dof.rig.clock import wait_until

    due = time.monotonic()
    end = None if seconds is None else due + seconds
    show, done = _display(talk, view)
    try:
        while True:
            reading = source()
            if reading is None:
                talk.note("the session has ended")
                return
            view.add(reading)
            show()
            due = max(due + PERIOD_S, time.monotonic())
            if end is not None and due > end:
                return
            wait_until(due)
    finally:
        done()


def _display(talk: Talk, view: View) -> tuple[Callable[[], None], Callable[[], None]]:
    """Show the view; take the display away."""
    if talk.quiet:
        return (lambda: None), (lambda: None)
    if not live_allowed():

        def line() -> None:
            if view.readings % LINE_EVERY == 1:
                talk.note(view.line())

        return line, (lambda: None)
    from rich.live import Live

    live = Live(console=talk.err, auto_refresh=False, transient=False)
    live.start()
    return (lambda: live.update(view.table(), refresh=True)), live.stop
