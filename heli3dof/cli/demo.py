"""``demo``: the whole chain on the emulated rig, with no hardware and no arguments."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from heli3dof.cli.options import AsJson, Quiet, Seed
from heli3dof.cli.output import Talk, verb

if TYPE_CHECKING:
    from heli3dof.experiment.plan import Plan
    from heli3dof.recording.recording import Recording

FOLDER = Path("heli3dof-demo")
HIDDEN = "motor.lag:0.1,friction.coulomb.yaw:0.03"
"""What the demo's rig hides: rotors that follow late, and dry friction in yaw. No part of the demo
is told; the diagnosis has to find them."""


def register(app: typer.Typer) -> None:
    app.command("demo")(demo)


@verb
def demo(seed: Seed = 1, as_json: AsJson = False, quiet: Quiet = False) -> None:
    """Fly the emulated rig, identify, compare, diagnose and report. No hardware needed."""
    from heli3dof.cli.compare import write_figures
    from heli3dof.cli.diagnose import saying
    from heli3dof.cli.inputs import both
    from heli3dof.comparison.compare import compare
    from heli3dof.diagnosis.diagnose import diagnose
    from heli3dof.diagnosis.document import document as to_document
    from heli3dof.experiment.plan import load_plan, step_plan
    from heli3dof.model.linear.hover import hover_model
    from heli3dof.model.model_file import save_model
    from heli3dof.paper.reproduction import reproduce
    from heli3dof.report.comparison_tables import comparison_renderables
    from heli3dof.report.diagnosis_figure_data import pictured
    from heli3dof.report.diagnosis_section import diagnosis_section
    from heli3dof.report.diagnosis_tables import diagnosis_tables
    from heli3dof.report.flight_report import flight_report
    from heli3dof.report.html import write_page
    from heli3dof.report.identification_section import identification_section, parameters_table
    from heli3dof.report.text_table import Grid, to_rich
    from heli3dof.rig.profile import default_profile

    talk = Talk(as_json=as_json, quiet=quiet)
    folder = _fresh(FOLDER)
    talk.note(
        "An emulated rig that hides two effects from the simulation: let us see which.\n"
        f"Everything goes to {folder}/"
    )
    train = _flown(talk, load_plan("rich"), folder / "rich.mcap", seed)
    step = _flown(
        talk,
        step_plan((10.0, None, 20.0), settle_s=5.0),
        folder / "step-roll-10-yaw-20.mcap",
        seed + 1,
        start="level",  # a linear model about level is not judged by a take-off from the table
    )
    with talk.working("Identifying a black box and a grey box from the rich flight …"):
        found = both([train], [step])
    saved = [save_model(f.model, folder / f"{f.model.name.replace(' ', '-')}.json") for f in found]
    talk.show(to_rich(parameters_table(found[-1])))
    with talk.working("Comparing them and the hover model with the step flight …"):
        models = [hover_model(step.profile), *(f.model for f in found)]
        comparison = compare([step], models)
        write_figures(comparison, folder, force=False)
    published = reproduce(hover_model(default_profile()))
    talk.show(*comparison_renderables(comparison, published))
    talk.note("Diagnosing the rich flight …")
    with saying(talk) as says:
        wrong = diagnose(train, step, quick=True, seed=seed, says=says)
        assert wrong.fitted is not None  # the emulated rig's recordings are sound
        extended = save_model(wrong.fitted.model, folder / "extended.json")
    document = to_document(wrong, str(extended))
    told = diagnosis_tables(document)
    talk.show(*(to_rich(g) if isinstance(g, Grid) else g for g in told))
    with talk.working("Writing the report …"):
        told_of = diagnosis_section(document, pictured(wrong, [train], [step]))
        text = flight_report(
            [step],
            models=models,
            comparison=comparison,
            reproduced=published,
            extra=[*(identification_section(f) for f in found), told_of],
            title="heli3dof demo",
        )
        report = write_page(text, folder / "report.html")
    talk.show(f"What the rig hid, and no part of this was told: {HIDDEN.replace(',', ', ')}")
    talk.note(f"Report: {report.resolve()}")
    talk.emit(
        {
            "schema": "heli3dof.demo/1",
            "folder": str(folder),
            "report": str(report),
            "recordings": [str(folder / f"{r.name}.mcap") for r in (train, step)],
            "models": [str(path) for path in (*saved, extended)],
            "hidden": HIDDEN,
            "diagnosis": document,
            "warnings": [*(w for f in found for w in f.warnings), *comparison.warnings],
        }
    )


def _flown(talk: Talk, plan: Plan, path: Path, seed: int, start: str = "rest") -> Recording:
    from heli3dof.cli.progress import progress
    from heli3dof.experiment.control_loop.loop import Live
    from heli3dof.experiment.fly import fly_plan

    talk.note(f"Flying {plan.name}, {plan.duration_s:g} s, faster than real time …")
    live = Live()
    with progress(talk, live, plan.name):
        flight = fly_plan(
            plan,
            device=f"mock:?speed=max&seed={seed}&start={start}&hide={HIDDEN}",
            seed=seed,
            output=path,
            live=live,
        )
    flight.raise_if_cut_short()
    return flight.recording


def _fresh(folder: Path) -> Path:
    """The folder, or the next one that does not exist yet: an earlier demo is kept."""
    from heli3dof.recording.atomic_write import new_folder

    number, path = 1, folder
    while path.exists():
        number += 1
        path = folder.with_name(f"{folder.name}-{number}")
    return new_folder(path, fix="cd to a folder of your own")
