"""``heli3dof run``: flies a plan in closed loop and records it; ``--auto`` also diagnoses."""

from __future__ import annotations

import sys
from contextlib import nullcontext
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from heli3dof.cli import completion
from heli3dof.cli.options import (
    Device,
    DryRun,
    Force,
    OutputFile,
    ProfileFile,
    Quick,
    Seed,
    rig_profile,
)
from heli3dof.cli.output import INTERRUPTED, Output, stages, verb
from heli3dof.cli.progress import fly_with_progress
from heli3dof.cli.renamed_options import renamed
from heli3dof.errors import Heli3dofError, UsageError, minus

if TYPE_CHECKING:
    from heli3dof.diagnosis.planning.run_auto import AutoResult
    from heli3dof.experiment.fly import Flight
    from heli3dof.experiment.plan import Plan
    from heli3dof.recording.recording import Recording
    from heli3dof.rig.profile import Profile

FIRST = "rich"
"""The plan that `run --auto` flies first by default"""


def register(app: typer.Typer) -> None:
    app.command("run", cls=renamed({"--budget": "--budget-min"}), rich_help_panel="Fly")(run)


@verb
def run(
    out: Output,
    plan: Annotated[
        str | None,
        typer.Argument(
            metavar="PLAN", help="A plan's name, or its TOML file.", autocompletion=completion.plans
        ),
    ] = None,
    auto: Annotated[
        bool,
        typer.Option("--auto", help="Fly, diagnose and fly again until no causes are confounded."),
    ] = False,
    budget_min: Annotated[
        float,
        typer.Option(
            "--budget-min", metavar="MIN", min=0.1, help="With --auto: minutes of flight."
        ),
    ] = 10.0,
    quick: Quick = False,
    device: Device = "mock:",
    profile: ProfileFile = None,
    output: OutputFile = None,
    force: Force = False,
    seed: Seed = 0,
    dry_run: DryRun = False,
) -> None:
    """Fly a plan and record it: heli3dof run steps, or heli3dof run my-plan.toml."""
    from heli3dof.experiment.plan import load_plan

    if plan is None and not auto:
        raise UsageError(
            "There is nothing to fly.",
            cause="neither a plan nor --auto was given.",
            fix="heli3dof run rich, or heli3dof run --auto",
        )
    chosen = load_plan(plan or FIRST)
    rig = rig_profile(profile).with_controller()
    if not auto:
        fly(out, chosen, device, rig, output, force, seed, dry_run)
    elif dry_run:
        out.show(f"Automatic: {chosen.name} first, at most {budget_min:g} min of flight.")
        _show_plan(out, chosen, rig, device, seed)
    else:
        _fly_auto(out, chosen, device, rig, output, budget_min, quick, seed)


def fly(
    out: Output,
    plan: Plan,
    device: str,
    profile: Profile,
    output: Path | None,
    force: bool,
    seed: int,
    dry_run: bool,
) -> None:
    """Fly a plan on a rig, record it, and print progress and a summary.

    ``device``: URL; ``output``: recording file, None for a new name from `default_path`;
    ``dry_run``: only check and print the plan. A flight that did not complete its plan ends the
    program with the exit code of the flight's error.
    """
    from heli3dof.experiment.control_loop.signal_handling import ignore_signals
    from heli3dof.recording.atomic_write import check_outputs, new_folder, reserved

    if dry_run:
        _show_plan(out, plan, profile, device, seed)
        return
    name = output or default_path(plan.name)
    if output is None:
        new_folder(name.parent)
        force = True  # replaces only the empty file that reserves the name
    meta = {"command_line": ["heli3dof", *sys.argv[1:]]}
    with nullcontext(name) if output else reserved(name) as path:
        check_outputs(path, force=force)
        flight = fly_with_progress(out, plan, profile, device, seed, path, force=force, meta=meta)
    ignore_signals()
    _show_flight(out, flight)
    outcome = flight.outcome
    if outcome.ending == "interrupted":
        end = "ramped to zero" if outcome.ramped else "set to zero volts at once"
        end = end if outcome.landed else "stopped at once"
        out.warn(f"{outcome.detail}; the motors were {end}")
        raise typer.Exit(INTERRUPTED)
    try:
        flight.raise_if_cut_short()
    except Heli3dofError as error:
        # On stderr only: the JSON document of the flight already contains the outcome.
        Output().print_error(error)
        raise typer.Exit(error.exit_code) from None


def _fly_auto(
    out: Output,
    plan: Plan,
    device: str,
    profile: Profile,
    output: Path | None,
    budget_min: float,
    quick: bool,
    seed: int,
) -> None:
    from heli3dof.diagnosis.planning.run_auto import run_auto

    result = run_auto(
        plan,
        device=device,
        profile=profile,
        folder=output or default_path(f"auto-{plan.name}").with_suffix(""),
        budget_min=budget_min,
        quick=quick,
        seed=seed,
        fly=lambda plan, path, seed: fly_one(out, plan, device, profile, path, seed),
        diagnosing=lambda: stages(out),
        each=out.show,
    )
    out.emit(_auto_document(out, result))


def _auto_document(out: Output, result: AutoResult) -> dict[str, Any]:
    """Write model and report, print the diagnosis; return the JSON document of ``run --auto``."""
    from heli3dof.cli.diagnose import show_diagnosis
    from heli3dof.diagnosis.document import diagnosis_document as to_document
    from heli3dof.model.model_file import save_model
    from heli3dof.report.pages.flight_report import diagnosis_page
    from heli3dof.report.pages.html import write_page

    diagnosis, folder = result.diagnosis, result.folder
    model = None
    if diagnosis.fitted is not None:
        model = str(save_model(diagnosis.fitted.model, folder / "extended.json"))
    document = to_document(diagnosis, model, result.next_experiment)
    out.show(f"Ended: {result.ended}.")
    show_diagnosis(out, document)
    title = f"Diagnosis: {folder.name}"
    text = diagnosis_page(diagnosis, document, list(result.recordings), title=title)
    report = write_page(text, folder / "report.html")
    out.note(f"Report: {report}")
    return {
        "schema": "heli3dof.auto/1",
        "folder": str(folder),
        "flights": [str(path) for path in result.paths],
        "ended": result.ended,
        "report": str(report),
        "diagnosis": document,
    }


def fly_one(
    out: Output, plan: Plan, device: str, profile: Profile, path: Path, seed: int, remark: str = ""
) -> Recording:
    """Fly a plan, record it to the file ``path``, and return the recording.

    Unlike `fly`, prints no summary, and raises an exception if the flight does not complete the
    plan. ``remark``: text to append to the note that is printed before the flight.
    """
    out.note(f"Flying {plan.name}, {plan.duration_s:g} s{remark} …")
    flight = fly_with_progress(out, plan, profile, device, seed, path)
    flight.raise_if_cut_short()
    return flight.recording


def default_path(name: str) -> Path:
    """Return the relative path ``flights/<UTC time>-<name>.mcap`` for a new recording."""
    from heli3dof.recording.atomic_write import file_name

    stamp = datetime.now(UTC).strftime("%Y%m%d-%H%M%S")
    return Path("flights") / f"{stamp}-{file_name(name)}.mcap"


def _show_plan(out: Output, plan: Plan, profile: Profile, device: str, seed: int) -> None:
    """Check plan, controller and device URL, and print the plan (``--dry-run``)."""
    from heli3dof.experiment.fly import prepare
    from heli3dof.rig.drivers import check_url, is_private, open_driver

    url = check_url(device)
    if is_private(url):  # an emulated rig, whose options are checked when it is opened
        open_driver(url, profile).close()
    signals = prepare(plan, profile, seed)
    out.warn(*signals.warnings(profile))
    out.show(f"Dry run: {plan.name}, {plan.duration_s:g} s on {device}, {profile.name}")
    out.show("The plan stays within the limits, and the gain stabilises the hover model.")
    out.show(*(minus(f"  {line}") for line in plan.summary()))
    out.emit(
        {
            "schema": "heli3dof.dry_run/1",
            "plan": plan.to_dict(),
            "duration_s": plan.duration_s,
            "periods": len(signals.t),
            "device": device,
            "profile": profile.to_dict(),
        }
    )


def _show_flight(out: Output, flight: Flight) -> None:
    from heli3dof.cli.flight_summary import flight_document, flight_table
    from heli3dof.cli.timing_summary import realtime_advice
    from heli3dof.recording.info import flight_warnings

    out.show(flight_table(flight))
    out.warn(*flight_warnings(flight.recording))
    advice = realtime_advice(flight.outcome)
    if advice:
        out.note(advice)
    out.note(f"Recording: {flight.path}")
    out.emit(flight_document(flight))
