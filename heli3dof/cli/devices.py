"""``devices``: which rigs can be opened, on every door, and who flies them."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Annotated, Any

import typer

from heli3dof.cli.options import AsJson, ProfileFile, Quiet
from heli3dof.cli.output import Talk, verb


def register(app: typer.Typer) -> None:
    app.command("devices")(devices)


@verb
def devices(
    ask: Annotated[
        bool,
        typer.Option(
            "--ask", help="Open each and ask who it is. Opening a port resets some boards."
        ),
    ] = False,
    profile: ProfileFile = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """List the rigs that can be opened, each driver that is installed, and what flies now."""
    from rich.table import Table

    from heli3dof.rig.drivers import find_rigs
    from heli3dof.rig.session.client import running
    from heli3dof.rig.session.paths import device_name

    talk = Talk(as_json=as_json, quiet=quiet)
    sessions = running()
    held = {device_name(s.device): s for s in sessions if not s.private}
    table = Table("driver", "device URL", "")
    drivers: list[dict[str, Any]] = []
    rigs: list[dict[str, Any]] = []
    for scheme, urls, problem in find_rigs():
        drivers.append({"driver": scheme, "devices": urls, "problem": problem})
        if problem is not None:
            talk.warn(f"the driver {scheme} does not load: {problem.splitlines()[0]}")
            table.add_row(scheme, "", "does not load")
        for url in urls:
            session = held.get(device_name(url))
            if session is not None:
                rigs.append({"device": url, "held_by": session.pid})
                table.add_row(scheme, url, f"pid {session.pid} runs {session.doing}")
                continue
            rigs.append({"device": url, "held_by": None, **(_asked(url, profile) if ask else {})})
            table.add_row(scheme, url, _told(rigs[-1]))
        if not urls and problem is None:
            table.add_row(scheme, "", "no rig found")
    for session in sessions:
        if session.private:
            scheme = session.device.partition(":")[0]
            table.add_row(scheme, session.device, f"pid {session.pid} runs {session.doing}")
    talk.show(table)
    talk.emit(
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


def _asked(url: str, profile_file: Path | None) -> dict[str, Any]:
    """Who answers; nothing is armed."""
    from heli3dof.errors import DeviceError
    from heli3dof.rig.profile import default_profile, load_profile
    from heli3dof.rig.session.open_exclusive import hold

    profile = load_profile(profile_file) if profile_file else default_profile()
    try:
        with hold(url, profile) as rig:
            identity, rest = dataclasses.asdict(rig.identity), rig.rest.to_dict()
    except DeviceError as problem:
        return {"identity": None, "problem": problem.what, "fix": problem.fix}
    return {"identity": identity, "rest": rest}


def _told(rig: dict[str, Any]) -> str:
    identity = rig.get("identity")
    if identity is not None:
        known = "zeroed" if rig["rest"]["known_from"] == "zero" else "not zeroed"
        return (
            f"{identity['model']}, serial {identity['serial']}, firmware {identity['firmware']}, "
            f"{known}"
        )
    return str(rig.get("problem", ""))
