"""``simulate``: a plan flown on a model, recorded like a flight."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from heli3dof.cli.options import AsJson, Force, Output, ProfileFile, Quiet, Seed
from heli3dof.cli.output import Talk, verb


class Start(StrEnum):
    rest = "rest"
    level = "level"


def register(app: typer.Typer) -> None:
    app.command("simulate")(simulate)


@verb
def simulate(
    plan: Annotated[str, typer.Argument(metavar="PLAN", help="A plan's TOML file, or its name.")],
    model: Annotated[
        str, typer.Option("--model", metavar="M", help="hover, hover-printed …, or a model file.")
    ] = "hover",
    start: Annotated[Start, typer.Option("--start", help="On the table, or level.")] = Start.rest,
    profile: ProfileFile = None,
    output: Output = None,
    force: Force = False,
    seed: Seed = 0,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Fly a plan on a model: heli3dof simulate steps --model hover."""
    from heli3dof.cli.flight_summary import recording_document, recording_table
    from heli3dof.experiment.plan import load_plan
    from heli3dof.experiment.simulate import simulate as fly_on_model
    from heli3dof.paper.models import load_model
    from heli3dof.recording.atomic_write import check_outputs
    from heli3dof.recording.write import write_recording
    from heli3dof.rig.profile import default_profile, load_profile

    talk = Talk(as_json=as_json, quiet=quiet)
    rig = (load_profile(profile) if profile else default_profile()).with_controller()
    chosen = load_model(model, rig)
    flown = load_plan(plan)
    path = output or Path(f"{flown.name}-on-{chosen.name}.mcap")
    check_outputs(path, force=force, inputs=[Path(model), Path(plan)])
    with talk.working(f"Flying {flown.name} on {chosen.name} …"):
        recording = fly_on_model(
            flown, chosen, profile=rig, seed=seed, start="rest" if start is Start.rest else "level"
        )
        write_recording(recording, path, force=force)
    talk.show(recording_table(recording, f"{flown.name} on {chosen.name}"))
    talk.note(f"Recording: {path}")
    talk.emit(
        {
            "schema": "heli3dof.simulation/1",
            "recording": str(path),
            "model": chosen.name,
            "digest": recording.digest,
            "axes": recording_document(recording),
        }
    )
