"""``heli3dof estop``: stops a rig from any terminal. It imports only what stopping needs."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from getopt import GetoptError, getopt
from typing import Annotated

import typer

from heli3dof.cli.output import Output, verb
from heli3dof.errors import quoted

REASON = "heli3dof estop, from another terminal"


def register(app: typer.Typer) -> None:
    app.command("estop", rich_help_panel="Plans and rigs")(estop)


@verb
def estop(
    out: Output,
    device: Annotated[
        str | None,
        typer.Option("--device", metavar="URL", help="Default: every rig in use or found."),
    ] = None,
    reason: Annotated[
        str, typer.Option("--reason", help="Stored in the recording of the flight that it ends.")
    ] = REASON,
) -> None:
    """Stop now: zero volts on the rig, even if another process flies it."""
    from heli3dof.rig.session.estop import request_estop

    result = request_estop(device, reason)
    for rig in result.stopped:
        if not out.quiet:  # not by rich, which takes longer to import than the stop takes
            text = f"Stopped {rig.device} in {rig.seconds * 1e3:.0f} ms: {rig.how}."
            typer.echo(text, err=out.as_json)
    result.raise_if_not_stopped(device)
    for rig in result.unconfirmed:
        out.warn(f"{rig.device} did not confirm. No process here flies it: {rig.how}")
    for url in result.skipped:
        out.warn(
            f"{url} was skipped: no rig was ever opened there. If it is a rig: "
            f"heli3dof estop --device {quoted(url)}"
        )
    out.emit(
        {
            "schema": "heli3dof.estop/1",
            "stopped": [
                {"device": s.device, "how": s.how, "seconds": s.seconds} for s in result.stopped
            ],
            "unconfirmed": [{"device": s.device, "why": s.how} for s in result.unconfirmed],
            "left_out": result.skipped,
        }
    )


def estop_without_typer(words: Sequence[str]) -> None:
    """Run ``estop`` with the arguments ``words`` and exit; return if getopt cannot parse them.

    This is faster than through typer, which loads pydantic to parse options.
    """
    try:
        options, rest = getopt(list(words), "", ["device=", "reason=", "json", "quiet"])
    except GetoptError:
        return
    if rest:
        return
    given = dict(options)
    try:
        estop(
            device=given.get("--device"),
            reason=given.get("--reason", REASON),
            as_json="--json" in given,
            quiet="--quiet" in given,
        )
    except typer.Exit as end:
        sys.exit(end.exit_code)
    sys.exit(0)
