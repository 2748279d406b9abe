"""``estop``: stop now, from any terminal. Nothing is imported that stopping does not need."""

from __future__ import annotations

from typing import Annotated

import typer

from heli3dof.cli.options import AsJson, Quiet
from heli3dof.cli.output import Talk, verb


def register(app: typer.Typer) -> None:
    app.command("estop")(estop)


@verb
def estop(
    device: Annotated[
        str | None,
        typer.Option(
            "--device", metavar="URL", help="Which rig; default: every one that runs or is found."
        ),
    ] = None,
    reason: Annotated[
        str, typer.Option("--reason", help="Kept in the recording of the flight that it ends.")
    ] = "heli3dof estop, from another terminal",
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Stop now: zero volts on the rig, even while another process flies it."""
    from heli3dof.errors import DeviceError
    from heli3dof.rig.session.estop import stop_rigs

    stopped, left_out = stop_rigs(device, reason)
    talk = Talk(as_json=as_json, quiet=quiet)
    if not stopped and left_out:
        raise DeviceError(
            f"No rig was stopped: none runs, and no rig was ever opened at {', '.join(left_out)}.",
            cause="what is behind these ports may be another instrument, so nothing was sent. A "
            "flight begun before now will not arm.",
            fix=" && ".join(f"heli3dof estop --device {url}" for url in left_out)
            + "; or switch off the amplifier",
        )
    if not stopped:
        raise DeviceError(
            "No rig was stopped: none runs, and none was found"
            + (f" at {device}." if device else "."),
            cause="it belongs to another user's session, or is not plugged in. A flight of yours "
            "that is just starting was begun before now and will not arm.",
            fix="switch off the amplifier; heli3dof devices lists what can be reached",
        )
    done = [s for s in stopped if s.done]
    failed = [s for s in stopped if not s.done]
    _say(talk, [f"Stopped {s.device} in {s.seconds * 1e3:.0f} ms: {s.how}." for s in done])
    # What was only found may be no rig at all, and nothing of ours moves it.
    if failed and (device is not None or not done or any(s.held for s in failed)):
        raise DeviceError(
            "NOT STOPPED: " + "; ".join(f"{s.device}: {s.how}" for s in failed),
            cause="the cable is out, the device hangs, or the port is not yours to open.",
            fix="switch off the amplifier; its watchdog stops it when nobody commands it",
        )
    for each in failed:
        talk.warn(f"{each.device} did not confirm, and nothing here flies it: {each.how}")
    for url in left_out:
        talk.warn(
            f"{url} was left out: no rig was ever opened there. If it is one: "
            f"heli3dof estop --device {url}"
        )
    talk.emit(
        {
            "schema": "heli3dof.estop/1",
            "stopped": [{"device": s.device, "how": s.how, "seconds": s.seconds} for s in done],
            "unconfirmed": [{"device": s.device, "why": s.how} for s in failed],
            "left_out": left_out,
        }
    )


def _say(talk: Talk, lines: list[str]) -> None:
    """Plain text: a console library would take longer to load than stopping takes."""
    if not talk.quiet:
        for line in lines:
            typer.echo(line, err=talk.as_json)
