"""``devices``: which rigs can be opened, on every door."""

from __future__ import annotations

import typer

from heli3dof.cli.console import Talk, verb
from heli3dof.cli.options import AsJson, Quiet


def register(app: typer.Typer) -> None:
    app.command("devices")(devices)


@verb
def devices(as_json: AsJson = False, quiet: Quiet = False) -> None:
    """List the rigs that can be opened, and each driver that is installed."""
    from rich.table import Table

    from heli3dof.rig.drivers import find_rigs

    talk = Talk(as_json=as_json, quiet=quiet)
    table = Table("driver", "device URL", "")
    rows = []
    for scheme, urls, problem in find_rigs():
        rows.append({"driver": scheme, "devices": urls, "problem": problem})
        if problem is not None:
            table.add_row(scheme, "", f"does not load: {problem}")
        for url in urls:
            table.add_row(scheme, url, "")
        if not urls and problem is None:
            table.add_row(scheme, "", "no rig found")
    talk.show(table)
    talk.emit({"schema": "heli3dof.devices/1", "drivers": rows})
