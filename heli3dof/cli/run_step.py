"""``heli3dof run-step``: flies a step in closed loop and records it."""

from __future__ import annotations

from typing import Annotated

import typer

from heli3dof.cli.options import Device, DryRun, Force, OutputFile, ProfileFile, Seed, rig_profile
from heli3dof.cli.output import Output, verb
from heli3dof.cli.run import fly
from heli3dof.errors import UsageError


def register(app: typer.Typer) -> None:
    app.command("run-step", rich_help_panel="Fly")(run_step)


@verb
def run_step(
    out: Output,
    roll: Annotated[
        list[float] | None,
        typer.Option("--roll", "--elevation", help="Step to this roll angle, degrees."),
    ] = None,
    pitch: Annotated[
        list[float] | None, typer.Option("--pitch", help="Step to this pitch angle, degrees.")
    ] = None,
    yaw: Annotated[
        list[float] | None,
        typer.Option("--yaw", "--travel", help="Step to this yaw angle, degrees."),
    ] = None,
    settle: Annotated[
        float, typer.Option("--settle", min=0, help="Seconds to take off and level first.")
    ] = 10.0,
    duration: Annotated[float, typer.Option("--duration", help="Seconds after the step.")] = 20.0,
    device: Device = "mock:",
    profile: ProfileFile = None,
    output: OutputFile = None,
    force: Force = False,
    seed: Seed = 0,
    dry_run: DryRun = False,
) -> None:
    """Fly a step in closed loop and record it: heli3dof run-step --roll 10."""
    from heli3dof.experiment.plan import step_plan

    targets = [each or [] for each in (roll, pitch, yaw)]
    if any(len(each) > 1 for each in targets):
        raise UsageError(
            "run-step steps each axis to one angle, but an axis has two.",
            cause="--elevation is another name of --roll, and --travel of --yaw.",
            fix="give each axis once; heli3dof run PLAN.toml flies several steps",
        )
    if not any(targets):
        raise UsageError(
            "run-step needs the angle to step to.",
            cause="none of --roll, --pitch and --yaw was given.",
            fix="heli3dof run-step --roll 10",
        )
    one, two, three = (each[0] if each else None for each in targets)
    plan = step_plan((one, two, three), settle_s=settle, duration_s=duration)
    rig = rig_profile(profile).with_controller()
    fly(out, plan, device, rig, output, force, seed, dry_run)
