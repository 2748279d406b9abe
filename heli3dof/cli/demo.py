"""``heli3dof demo``: flight, identification, comparison and diagnosis on an emulated rig."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from heli3dof.cli.options import Seed
from heli3dof.cli.output import Output, verb

if TYPE_CHECKING:
    from heli3dof.experiment.plan import Plan
    from heli3dof.recording.recording import Recording

FOLDER = Path("heli3dof-demo")
HIDDEN = "motor.lag:0.1,friction.coulomb.yaw:0.03"
"""Effects that the emulated rig has and the simulation lacks: a motor lag of 0.1 s and Coulomb
friction of 0.03 N·m in yaw. The demo passes them to the emulator only."""


def register(app: typer.Typer) -> None:
    app.command("demo", rich_help_panel="Fly")(demo)


@verb
def demo(out: Output, seed: Seed = 1) -> None:
    """Fly an emulated rig; identify, compare and diagnose models; report. Needs no hardware.

    Example: heli3dof demo
    """
    from heli3dof.cli.compare import show_comparison, write_figures
    from heli3dof.cli.diagnose import show_diagnosis
    from heli3dof.cli.inputs import identify_both
    from heli3dof.cli.output import stages
    from heli3dof.comparison.compare import compare
    from heli3dof.diagnosis.diagnose import diagnose
    from heli3dof.diagnosis.document import diagnosis_document as to_document
    from heli3dof.experiment.plan import load_plan, step_plan
    from heli3dof.model.linear.hover import hover_model
    from heli3dof.model.model_file import save_model
    from heli3dof.recording.atomic_write import default_output, new_folder
    from heli3dof.report.figures.diagnosis_data import figure_data
    from heli3dof.report.pages.flight_report import Diagnosed, flight_report
    from heli3dof.report.pages.html import write_page
    from heli3dof.report.text.identification_tables import parameters_table

    folder = new_folder(default_output(FOLDER, force=False), fix="cd to a folder of your own")
    out.note(
        "The emulated rig has two effects that the simulation lacks. The demo has to find them.\n"
        f"All files go to {folder}/"
    )
    train = _fly(out, load_plan("rich"), folder / "rich.mcap", seed)
    step = _fly(
        out,
        step_plan((10.0, None, 20.0), settle_s=5.0),
        folder / "step-roll-10-yaw-20.mcap",
        seed + 1,
        start="level",  # a take-off is outside the range of a model linear about level
    )
    with out.working("Identifying a black box and a grey box from the rich flight …"):
        identified = identify_both([train], [step])
    saved = [
        save_model(i.model, folder / f"{i.model.name.replace(' ', '-')}.json") for i in identified
    ]
    out.show(parameters_table(identified[-1], brief=True))
    with out.working("Comparing them and the hover model with the step flight …"):
        models = [hover_model(step.profile), *(i.model for i in identified)]
        comparison = compare([step], models)
        write_figures(comparison, folder, force=False)
    show_comparison(out, comparison)
    out.note("Diagnosing the rich flight, and measuring the gain on the step flight …")
    with stages(out) as stage:
        diagnosis = diagnose(train, step, quick=True, seed=seed, progress=stage)
        assert diagnosis.fitted is not None  # the emulated rig's recordings have no faults
        extended = save_model(diagnosis.fitted.model, folder / "extended.json")
    document = to_document(diagnosis, str(extended))
    show_diagnosis(out, document)
    with out.working("Writing the report …"):
        text = flight_report(
            [step],
            models=models,
            comparison=comparison,
            identified=identified,
            diagnosed=Diagnosed(document, figure_data(diagnosis, [train], [step])),
            title="heli3dof demo",
        )
        report = write_page(text, folder / "report.html")
    out.show(f"The effects that the emulated rig really has: {HIDDEN.replace(',', ', ')}")
    out.note(f"Report: {report.resolve()}")
    out.emit(
        {
            "schema": "heli3dof.demo/1",
            "folder": str(folder),
            "report": str(report),
            "recordings": [str(folder / f"{r.name}.mcap") for r in (train, step)],
            "models": [str(path) for path in (*saved, extended)],
            "hidden": HIDDEN,
            "diagnosis": document,
            "warnings": [*(w for i in identified for w in i.warnings), *comparison.warnings],
        }
    )


def _fly(out: Output, plan: Plan, path: Path, seed: int, start: str = "rest") -> Recording:
    from heli3dof.cli.run import fly_one
    from heli3dof.rig.profile import default_profile

    device = f"mock:?speed=max&seed={seed}&start={start}&hide={HIDDEN}"
    return fly_one(out, plan, device, default_profile(), path, seed, ", faster than real time")
