"""``diagnose``: what the simulation gets wrong, the cause, the extended model, the gain."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from heli3dof.cli.console import Talk, verb
from heli3dof.cli.options import AsJson, Force, Output, ProfileFile, Quiet, Recordings, Seed


def register(app: typer.Typer) -> None:
    app.command("diagnose")(diagnose)


@verb
def diagnose(
    recordings: Recordings,
    holdout: Annotated[
        list[Path] | None,
        typer.Option("--holdout", metavar="REC", help="Measure the gain on this. Repeatable."),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer simulated nulls.")] = False,
    profile: ProfileFile = None,
    output: Output = None,
    force: Force = False,
    seed: Seed = 0,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """What the simulation gets wrong, and why: heli3dof diagnose rec.mcap -o model.json."""
    from heli3dof.cli.loading import load_all
    from heli3dof.diagnosis.diagnose import diagnose as find
    from heli3dof.diagnosis.document import document
    from heli3dof.model.modelfile import save_model
    from heli3dof.recording.output import check_output

    talk = Talk(as_json=as_json, quiet=quiet)
    path = output or Path(f"{recordings[0].name.split('.')[0]}-extended.json")
    check_output(path, force=force)
    train = load_all(talk, recordings, profile)
    test = load_all(talk, holdout or [], profile)
    found = find(train, test or None, quick=quick, seed=seed, says=talk.note)
    save_model(found.model, path, force=force)
    talk.show(f"Verdict: {found.verdict.replace('_', ' ')}")
    for f in found.findings:
        sizes = ", ".join(f"{n} = {v:.4g} ± {s:.2g}" for n, (v, s) in f.values.items())
        tie = f"; tied with {', '.join(f.choice.tied_with)}" if f.choice.tied_with else ""
        talk.show(f"  {f.choice.term.name}: {sizes} (confidence {f.choice.confidence:.3f}{tie})")
    for name in found.calibration_findings:
        talk.show(f"  {name}: the rig is off its profile by more than the tolerance")
    for axis, e in found.before.items():
        if e is not None:
            talk.show(
                f"  {axis}: {e:.3f}° wrong 1 s ahead, {found.after[axis] or 0:.3f}° extended, "
                f"{found.noise_floor[axis] or 0:.3f}° by noise alone"
            )
    talk.note(f"Nulls: {found.about['nulls']}; gain measured on {found.about['gain_measured_on']}.")
    talk.note(f"Model: {path}")
    talk.emit(document(found, str(path)))
