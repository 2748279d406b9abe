"""Choose the device URL: ``--device``, or by default the rig that is found.

The default is the real rig if exactly one is found, and the emulated rig if none is.
"""

from __future__ import annotations

from typing import Annotated

import typer

from heli3dof.cli import completion
from heli3dof.cli.output import Output
from heli3dof.rig.url import DEVICE_VARIABLE

AnyDevice = Annotated[
    str | None,
    typer.Option(
        "--device",
        metavar="URL",
        envvar=DEVICE_VARIABLE,
        autocompletion=completion.devices,
        help="The rig; default: the only one found, else the emulated one.",
    ),
]


def device_or_default(out: Output, device: str | None) -> str:
    """Return ``device``; if it is None, the URL of the rig that is found.

    The rig found is the real rig if there is exactly one. If there is none, it is the emulated rig,
    and this function prints a note. Raises UsageError if several real rigs are found, or if
    ``device`` has a wrong scheme or option.
    """
    from heli3dof.rig.drivers import MOCK, check_url, found_device

    if device is not None:
        check_url(device)
        return device
    found = found_device()
    if found == MOCK:
        out.note("No rig was found. This is the emulated one; --device selects another.")
    return found
