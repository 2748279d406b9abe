"""Default device when ``--device`` is omitted: the only real rig found, else the mock."""

from __future__ import annotations

from typing import Annotated

import typer

from heli3dof.cli.output import Talk

MOCK = "mock:"

AnyDevice = Annotated[
    str | None,
    typer.Option(
        "--device",
        metavar="URL",
        envvar="HELI3DOF_DEVICE",
        help="Which rig; default: the only one that is found, else the emulated one.",
    ),
]


def the_rig(talk: Talk, device: str | None) -> str:
    """The device asked for, else the only real rig found, else `MOCK`, and that is said.

    Raises UsageError where several are there, and for a URL without a driver.
    """
    from heli3dof.errors import UsageError
    from heli3dof.rig.drivers import find_rigs, is_private, load_driver
    from heli3dof.rig.url import parse_url

    if device is not None:
        url = parse_url(device)
        url.check_options(load_driver(url.scheme).options)
        return device
    real = [url for _, urls, _ in find_rigs() for url in urls if not is_private(url)]
    if len(real) > 1:
        raise UsageError(
            f"Several rigs are there: {', '.join(real)}.",
            cause="the command was not told which.",
            fix=f"--device {real[0]}, or export HELI3DOF_DEVICE={real[0]}",
        )
    if not real:
        talk.note("No rig was found: this is about the emulated one (--device names another).")
        return MOCK
    return real[0]
