"""``heli3dof doctor``: checks link, permissions, clock, latency; prints a fix for each fault."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from heli3dof.cli.options import AnyDevice, ProfileFile, device_or_default, rig_profile
from heli3dof.cli.output import Output, verb
from heli3dof.errors import CheckFailed, DeviceError

if TYPE_CHECKING:
    from heli3dof.rig.interface import Check

LEVELS = {True: "ok", False: "FAIL", None: "?"}


def register(app: typer.Typer) -> None:
    app.command("doctor", rich_help_panel="Plans and rigs")(doctor)


@verb
def doctor(
    out: Output,
    device: AnyDevice = None,
    profile: ProfileFile = None,
    folder: Annotated[
        Path, typer.Option("--folder", metavar="DIR", help="The folder of the recordings.")
    ] = Path("flights"),
    arm: Annotated[
        bool,
        typer.Option(
            "--arm", help="Also arm at zero volts, to test the watchdog and the emergency stop."
        ),
    ] = False,
) -> None:
    """Check computer, disk, port and rig, and print how to correct each failure. Moves nothing.

    Example: heli3dof doctor --device serial:///dev/ttyACM0
    """
    from heli3dof.experiment.doctor import doctor

    url = device_or_default(out, device)
    used = rig_profile(profile)
    out.show(f"{url}, profile {used.name}")
    report = doctor(url, used, folder=folder, arm=arm, each=lambda check: _show(out, check))
    failed = len(report.failed)
    code = DeviceError.exit_code if not report.opened else CheckFailed.exit_code if failed else 0
    out.show(f"{failed} of {len(report.checks)} checks failed." if failed else "No check failed.")
    out.emit(
        {
            "schema": "heli3dof.doctor/1",
            "device": url,
            "opened": report.opened,
            "checks": [
                {"group": group, "what": c.what, "found": c.found, "good": c.good, "fix": c.fix}
                for group, c in report.checks
            ],
            "exit_code": code,
        }
    )
    if code:
        raise typer.Exit(code)


def _show(out: Output, check: Check) -> None:
    if out.quiet and check.good is False:
        fix = f" Try: {check.fix}" if check.fix else ""
        out.fail(f"{check.what}: {check.found}.{fix}")
    level = "WARN" if check.good is None and check.fix else LEVELS[check.good]
    out.show(f"{level:4}  {check.what}: {check.found}")
    if check.fix and check.good is not True:
        out.show(f"      → {check.fix}")
