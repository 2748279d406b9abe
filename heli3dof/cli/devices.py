"""``heli3dof devices``: lists the rigs that can be opened, and the processes that use them."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Annotated, Any

import typer

from heli3dof.cli.options import ProfileFile, rig_profile
from heli3dof.cli.output import Output, verb
from heli3dof.cli.renamed_options import renamed


def register(app: typer.Typer) -> None:
    app.command("devices", cls=renamed({"--ask": "--probe"}), rich_help_panel="Plans and rigs")(
        devices
    )


@verb
def devices(
    out: Output,
    probe: Annotated[
        bool,
        typer.Option(
            "--probe", help="Open each rig and read its identity. This resets some boards."
        ),
    ] = False,
    profile: ProfileFile = None,
) -> None:
    """List the rigs that can be opened, the installed drivers, and the rigs in use.

    Example: heli3dof devices
    """
    from rich.table import Table

    from heli3dof.rig.drivers import find_rigs
    from heli3dof.rig.session.client import running
    from heli3dof.rig.session.paths import device_name
    from heli3dof.rig.url import parse_url

    sessions = running()
    users = {device_name(s.device): s for s in sessions if not s.private}
    table = Table("driver", "device URL", "state")
    drivers: list[dict[str, Any]] = []
    rigs: list[dict[str, Any]] = []
    found = list(find_rigs())
    listed = {device_name(url) for _, urls, _ in found for url in urls}
    others = [s for s in sessions if s.private or device_name(s.device) not in listed]
    schemes = {parse_url(s.device).scheme for s in others}
    for scheme, urls, problem in found:
        drivers.append({"driver": scheme, "devices": urls, "problem": problem})
        if problem is not None:
            out.warn(f"the driver {scheme} does not load: {problem.splitlines()[0]}")
            table.add_row(scheme, "", "does not load")
        for url in urls:
            user = users.get(device_name(url))
            if user is not None:
                rigs.append({"device": url, "held_by": user.pid})
                table.add_row(scheme, url, f"in use: pid {user.pid}, {user.doing}")
                continue
            rigs.append({"device": url, "held_by": None, **(_probe(url, profile) if probe else {})})
            table.add_row(scheme, url, _state_text(rigs[-1]))
        if not urls and problem is None and scheme not in schemes:
            table.add_row(scheme, "", "no rig found")
    for session in others:
        state = f"in use: pid {session.pid}, {session.doing}"
        table.add_row(parse_url(session.device).scheme, session.device, state)
    out.show(table)
    out.emit(
        {
            "schema": "heli3dof.devices/1",
            "drivers": drivers,
            "rigs": rigs,
            "sessions": [
                {"device": s.device, "pid": s.pid, "doing": s.doing, "since_utc": s.since_utc}
                for s in sessions
            ],
        }
    )


def _probe(url: str, profile: Path | None) -> dict[str, Any]:
    """Open a rig without arming it; return its identity and its encoder counts at rest.

    If the rig cannot be opened, the entry ``problem`` gives the reason.
    """
    from heli3dof.errors import DeviceError
    from heli3dof.rig.session.open_exclusive import open_rig

    try:
        with open_rig(url, rig_profile(profile)) as rig:
            identity, rest = dataclasses.asdict(rig.identity), rig.rest.to_dict()
    except DeviceError as error:
        return {"identity": None, "problem": error.what, "fix": error.fix}
    return {"identity": identity, "rest": rest}


def _state_text(rig: dict[str, Any]) -> str:
    identity = rig.get("identity")
    if identity is None:
        return str(rig.get("problem", "free"))
    zeroed = "zeroed" if rig["rest"]["known_from"] == "zero" else "not zeroed"
    return "{model}, serial {serial}, firmware {firmware}, ".format(**identity) + zeroed
