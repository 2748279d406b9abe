"""``heli3dof simulate``: simulates a plan in closed loop on a model; writes a recording."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from heli3dof.cli import completion
from heli3dof.cli.options import Force, OutputFile, Seed, log_profile
from heli3dof.cli.options import Plan as PlanName
from heli3dof.cli.output import Output, verb


class Start(StrEnum):
    rest = "rest"
    level = "level"


def register(app: typer.Typer) -> None:
    app.command("simulate", rich_help_panel="Fly")(simulate)


@verb
def simulate(
    out: Output,
    plan: PlanName,
    model: Annotated[
        str,
        typer.Option(
            "--model",
            metavar="M",
            help="hover, hover-printed …, or a model file.",
            autocompletion=completion.models,
        ),
    ] = "hover",
    start: Annotated[
        Start, typer.Option("--start", help="Start at rest on the table, or level.")
    ] = Start.rest,
    profile: Annotated[
        Path | None,
        typer.Option(
            "--profile",
            metavar="FILE",
            help="The rig's profile; default: the one in the model file, else the paper's rig.",
        ),
    ] = None,
    output: OutputFile = None,
    force: Force = False,
    seed: Seed = 0,
) -> None:
    """Simulate a plan on a model: heli3dof simulate steps --model hover."""
    from heli3dof.cli.flight_summary import recording_document, recording_table
    from heli3dof.experiment.plan import load_plan
    from heli3dof.experiment.simulate import simulate
    from heli3dof.paper.models import load_model
    from heli3dof.recording.atomic_write import check_outputs, file_name
    from heli3dof.recording.write import write_recording

    rig = log_profile(profile)
    chosen = load_model(model, rig)
    flown = load_plan(plan)
    path = output or Path(file_name(f"{flown.name}-on-{chosen.name}.mcap"))
    check_outputs(path, force=force, inputs=[Path(model), Path(plan)])
    with out.working(f"Simulating {flown.name} on {chosen.name} …"):
        recording = simulate(
            flown, chosen, profile=rig, seed=seed, start="rest" if start is Start.rest else "level"
        )
        write_recording(recording, path, force=force)
    out.show(recording_table(recording, f"{flown.name} on {chosen.name}"))
    out.warn(*recording.meta.get("warnings", ()))
    out.note(f"Recording: {path}")
    out.emit(
        {
            "schema": "heli3dof.simulation/1",
            "recording": str(path),
            "model": chosen.name,
            "digest": recording.digest,
            "axes": recording_document(recording),
        }
    )
