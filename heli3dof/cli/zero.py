"""``heli3dof zero``: stores the encoder counts at the rest angles. It moves nothing."""

from __future__ import annotations

from typing import Annotated

import typer

from heli3dof.cli.options import AnyDevice, ProfileFile, device_or_default, rig_profile
from heli3dof.cli.output import Output, verb
from heli3dof.errors import minus

_HELP = "The rig stands at this {} angle now, degrees; default: its rest angle."


def register(app: typer.Typer) -> None:
    app.command("zero", rich_help_panel="Plans and rigs")(zero)


@verb
def zero(
    out: Output,
    roll: Annotated[
        float | None, typer.Option("--roll", "--elevation", help=_HELP.format("roll"))
    ] = None,
    pitch: Annotated[float | None, typer.Option("--pitch", help=_HELP.format("pitch"))] = None,
    yaw: Annotated[
        float | None, typer.Option("--yaw", "--travel", help=_HELP.format("yaw"))
    ] = None,
    device: AnyDevice = None,
    profile: ProfileFile = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Measure and print; store nothing.")
    ] = False,
) -> None:
    """Store the encoder counts of the rig at rest, or at the given angles. Moves nothing.

    Example: heli3dof zero --device serial:///dev/ttyACM0
    """
    from heli3dof.axes import AXES
    from heli3dof.rig.zero import MEASURE_S, zero

    url = device_or_default(out, device)
    result = zero(url, rig_profile(profile), angles_deg=(roll, pitch, yaw), store=not dry_run)
    measured = result.calibration
    if result.emulated:
        out.show("Nothing to store: an emulated rig always starts at rest.")
    elif result.stored is None:
        out.show("Dry run: nothing was stored.")
    else:
        out.show(f"Stored in {result.stored}. It applies to every flight{_until(measured.boot)}")
    out.show(f"{measured.serial} on {url}, at rest for {MEASURE_S:g} s:")
    for axis, counts, shift in zip(AXES, measured.counts_at_rest, result.shift_deg, strict=True):
        text = f"  {axis:5} {counts:+7d} counts  ({shift:+.2f}° from the value used before)"
        out.show(minus(text))
    out.emit(
        {
            "schema": "heli3dof.zero/1",
            "device": url,
            "serial": measured.serial,
            "boot": measured.boot,
            "counts_at_rest": measured.counts_at_rest,
            "shift_deg": dict(zip(AXES, result.shift_deg, strict=True)),
            "stored": None if result.stored is None else str(result.stored),
        }
    )


def _until(boot: int | None) -> str:
    if boot is None:
        return ". This device has no boot number: run zero again after switching it off."
    return " until the device restarts."
