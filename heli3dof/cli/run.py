"""The verbs that move motors: ``run-step`` and ``run``."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from heli3dof.cli.options import AsJson, Device, DryRun, Force, Output, ProfileFile, Quiet, Seed
from heli3dof.cli.output import INTERRUPTED, Talk, report, verb
from heli3dof.cli.progress import progress
from heli3dof.errors import Heli3dofError

if TYPE_CHECKING:
    from heli3dof.experiment.fly import Flight
    from heli3dof.experiment.plan import Plan
    from heli3dof.rig.profile import Profile

MOCK = "mock:"
FIRST = "rich"
"""What `run --auto` flies first where it is not told"""


def register(app: typer.Typer) -> None:
    app.command("run-step")(run_step)
    app.command("run")(run)


@verb
def run_step(
    roll: Annotated[
        float | None,
        typer.Option("--roll", "--elevation", help="Step to this roll angle, degrees."),
    ] = None,
    pitch: Annotated[
        float | None, typer.Option("--pitch", help="Step to this pitch angle, degrees.")
    ] = None,
    yaw: Annotated[
        float | None, typer.Option("--yaw", "--travel", help="Step to this yaw angle, degrees.")
    ] = None,
    settle: Annotated[
        float, typer.Option("--settle", min=0, help="Seconds to take off and level first.")
    ] = 10.0,
    duration: Annotated[float, typer.Option("--duration", help="Seconds after the step.")] = 20.0,
    device: Device = MOCK,
    profile: ProfileFile = None,
    output: Output = None,
    force: Force = False,
    seed: Seed = 0,
    dry_run: DryRun = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Fly a step in closed loop and record it: heli3dof run-step --roll 10."""
    from heli3dof.errors import UsageError
    from heli3dof.experiment.plan import step_plan

    if roll is None and pitch is None and yaw is None:
        raise UsageError(
            "run-step was not told where to step to.",
            cause="none of --roll, --pitch and --yaw was given.",
            fix="heli3dof run-step --roll 10",
        )
    plan = step_plan((roll, pitch, yaw), settle_s=settle, duration_s=duration)
    talk = Talk(as_json=as_json, quiet=quiet)
    _fly(talk, plan, device, profile, output, force, seed, dry_run)


@verb
def run(
    plan: Annotated[
        str | None, typer.Argument(metavar="PLAN", help="A plan's TOML file, or its name.")
    ] = None,
    auto: Annotated[
        bool, typer.Option("--auto", help="Fly, diagnose, fly what separates, until settled.")
    ] = False,
    budget: Annotated[
        float, typer.Option("--budget", metavar="MIN", min=0.1, help="With --auto: of flight.")
    ] = 10.0,
    quick: Annotated[
        bool, typer.Option("--quick", help="With --auto: fewer simulated nulls.")
    ] = False,
    device: Device = MOCK,
    profile: ProfileFile = None,
    output: Output = None,
    force: Force = False,
    seed: Seed = 0,
    dry_run: DryRun = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Fly any experiment: heli3dof run steps, or heli3dof run my-plan.toml."""
    from heli3dof.errors import UsageError
    from heli3dof.experiment.plan import load_plan

    if plan is None and not auto:
        raise UsageError(
            "run was not told what to fly.",
            cause="neither a plan nor --auto was given.",
            fix="heli3dof run rich, or heli3dof run --auto",
        )
    talk = Talk(as_json=as_json, quiet=quiet)
    chosen = load_plan(plan or FIRST)
    if auto and not dry_run:
        _fly_auto(talk, chosen, device, profile, output, budget, quick, seed)
        return
    if auto:
        talk.show(f"Automatic: {chosen.name} first, then what separates, {budget:g} min at most.")
    _fly(talk, chosen, device, profile, output, force, seed, dry_run)


def _fly_auto(
    talk: Talk,
    plan: Plan,
    device: str,
    profile_file: Path | None,
    output: Path | None,
    budget_min: float,
    quick: bool,
    seed: int,
) -> None:
    from heli3dof.cli.run_auto import run_auto
    from heli3dof.errors import OutputExists
    from heli3dof.rig.profile import default_profile, load_profile

    profile = load_profile(profile_file) if profile_file else default_profile()
    folder = output or default_path(f"auto-{plan.name}").with_suffix("")
    if folder.exists():
        raise OutputExists(
            f"{folder} exists and was left as it is.",
            cause="--auto keeps its flights in a folder of their own.",
            fix="another name with -o",
        )
    document = run_auto(
        talk, plan, device=device, profile=profile.with_controller(), folder=folder,
        budget_min=budget_min, quick=quick, seed=seed,
    )  # fmt: skip
    talk.note(f"Report: {document['report']}")
    talk.emit(document)


def _fly(
    talk: Talk,
    plan: Plan,
    device: str,
    profile_file: Path | None,
    output: Path | None,
    force: bool,
    seed: int,
    dry_run: bool,
) -> None:
    import sys

    from heli3dof.experiment.control_loop.loop import Live
    from heli3dof.experiment.fly import fly_plan
    from heli3dof.recording.atomic_write import check_output, new_folder
    from heli3dof.rig.profile import default_profile, load_profile

    profile = load_profile(profile_file) if profile_file else default_profile()
    profile = profile.with_controller()
    if dry_run:
        _say_plan(talk, plan, profile, device, seed)
        return
    if output is None:
        output = default_path(plan.name)
        new_folder(output.parent)
    check_output(output, force=force)
    live = Live()
    with progress(talk, live, plan.name):
        flight = fly_plan(
            plan,
            device=device,
            profile=profile,
            seed=seed,
            output=output,
            force=force,
            meta={"command_line": ["heli3dof", *sys.argv[1:]]},
            live=live,
            warn=talk.warn,
        )
    _say_flight(talk, flight)
    if flight.outcome.ending == "interrupted":
        outcome = flight.outcome
        end = "ramped to zero" if outcome.ramped else "taken to zero volts at once"
        end = end if outcome.landed else "stopped at once"
        talk.warn(f"{outcome.detail}; the motors were {end}")
        raise typer.Exit(INTERRUPTED)
    try:
        flight.raise_if_cut_short()
    except Heli3dofError as error:
        # On stderr only: the one JSON document was the flight's, and says how it ended.
        report(error, as_json=False)
        raise typer.Exit(error.exit_code) from None


def default_path(name: str) -> Path:
    """``flights/<UTC time>-<plan>.mcap``, in the folder where the command is run."""
    stamp = datetime.now(UTC).strftime("%Y%m%d-%H%M%S")
    return Path("flights") / f"{stamp}-{name}.mcap"


def _say_plan(talk: Talk, plan: Plan, profile: Profile, device: str, seed: int) -> None:
    """The dry run: everything that would be refused is, and nothing is opened or moved."""
    from heli3dof.experiment.fly import prepare
    from heli3dof.rig.drivers import load_driver
    from heli3dof.rig.url import parse_url

    url = parse_url(device)
    url.check_options(load_driver(url.scheme).options)
    signals = prepare(plan, profile, seed)
    talk.show(f"Dry run: {plan.name}, {plan.duration_s:g} s on {device}, {profile.name}")
    for line in plan.summary():
        talk.show(f"  {line}")
    talk.show("The plan stays inside the envelope and the gain stabilises the hover model.")
    talk.emit(
        {
            "schema": "heli3dof.dry_run/1",
            "plan": plan.to_dict(),
            "duration_s": plan.duration_s,
            "periods": len(signals.t),
            "device": device,
            "profile": profile.to_dict(),
        }
    )


def _say_flight(talk: Talk, flight: Flight) -> None:
    """The summary at the end of a flight: peak, overshoot, error per axis, late periods."""
    from heli3dof.cli.flight_summary import flight_document, flight_table, flight_warnings
    from heli3dof.cli.timing_summary import realtime_advice

    talk.show(flight_table(flight))
    advice = realtime_advice(flight.outcome)
    if advice:
        talk.note(advice)
    for warning in flight_warnings(flight):
        talk.warn(warning)
    talk.note(f"Recording: {flight.path}")
    talk.emit(flight_document(flight))
