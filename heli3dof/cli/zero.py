"""``zero``: tell where the encoders stand at the rest angles. Moves nothing."""

from __future__ import annotations

from typing import Annotated

import typer

from heli3dof.cli.device_option import AnyDevice, the_rig
from heli3dof.cli.options import AsJson, ProfileFile, Quiet
from heli3dof.cli.output import Talk, verb

SECONDS = 1.0
_HELP = "The rig stands at this {} angle now, degrees; default: its rest angle."


def register(app: typer.Typer) -> None:
    app.command("zero")(zero)


@verb
def zero(
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
        bool, typer.Option("--dry-run", help="Measure and show, but store nothing.")
    ] = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Store where the encoders stand, with the rig at rest (or at the angles given)."""
    from math import degrees

    from heli3dof.axes import AXES
    from heli3dof.rig.calibration import POWER_UP, store_calibration
    from heli3dof.rig.drivers import is_private
    from heli3dof.rig.profile import default_profile, load_profile
    from heli3dof.rig.session.open_exclusive import hold
    from heli3dof.rig.zero import calibrate, watch_standing

    talk = Talk(as_json=as_json, quiet=quiet)
    url = the_rig(talk, device)
    rig_profile = load_profile(profile) if profile else default_profile()
    with hold(url, rig_profile) as rig:
        before, rig.rest = rig.rest, POWER_UP  # counts as the device gives them
        standing = watch_standing(rig, SECONDS)
        found = calibrate(standing, rig, rig_profile, url, (roll, pitch, yaw))
    shift = [
        degrees((found.counts_at_rest[i] - before.counts_at_rest[i]) * q)
        for i, q in enumerate(rig_profile.encoder.rad_per_count)
    ]
    talk.show(f"{found.serial} on {url}: stood still for {SECONDS:g} s")
    for i, axis in enumerate(AXES):
        talk.show(
            f"  {axis:5} {found.counts_at_rest[i]:+7d} counts at rest"
            f"  ({shift[i]:+.2f}° from what was taken before)"
        )
    stored = None
    if is_private(url):
        talk.show("Nothing to store: an emulated rig starts at rest whenever it is opened.")
    elif dry_run:
        talk.show("Dry run: nothing was stored.")
    else:
        stored = store_calibration(found)
        talk.show(f"Stored in {stored}; every flight of this rig goes by it" + _until(found.boot))
    talk.emit(
        {
            "schema": "heli3dof.zero/1",
            "device": url,
            "serial": found.serial,
            "boot": found.boot,
            "counts_at_rest": found.counts_at_rest,
            "shift_deg": dict(zip(AXES, shift, strict=True)),
            "stored": None if stored is None else str(stored),
        }
    )


def _until(boot: int | None) -> str:
    if boot is None:
        return ". Run it again after the device was switched off: this one has no boot number."
    return " until the device restarts."
