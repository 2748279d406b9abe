"""``run --auto``: fly, diagnose, fly what separates, until settled or out of budget.

    fly PLAN → diagnose all flights so far → settled? stop : fly the plan recommended → …

Settled is a diagnosis that asks for no further flight: no tie, and nothing that its flights could
not have shown. What they could not show is looked for by one flight of a plan, not by two. The
budget counts minutes of flight; a plan that would exceed it is not begun. Every flight is kept,
and one report tells of them all.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from heli3dof.cli.output import Talk

if TYPE_CHECKING:
    from heli3dof.diagnosis.outlook import NextExperiment
    from heli3dof.diagnosis.result import Diagnosis
    from heli3dof.experiment.plan import Plan
    from heli3dof.recording.recording import Recording
    from heli3dof.rig.profile import Profile


def run_auto(
    talk: Talk,
    first: Plan,
    *,
    device: str,
    profile: Profile,
    folder: Path,
    budget_min: float,
    quick: bool,
    seed: int,
) -> dict[str, Any]:
    """Fly and diagnose until settled; returns the document. Raises as a single flight does.

    The first plan is flown whatever the budget says: a budget below it is refused before.
    """
    from heli3dof.cli.diagnose import saying, show
    from heli3dof.diagnosis.diagnose import diagnose
    from heli3dof.diagnosis.document import document as to_document
    from heli3dof.diagnosis.next_experiment import next_of
    from heli3dof.errors import UsageError
    from heli3dof.experiment.plan import load_plan
    from heli3dof.model.model_file import save_model
    from heli3dof.recording.atomic_write import new_folder
    from heli3dof.report.diagnosis_page import diagnosis_page
    from heli3dof.report.html import write_page

    if first.duration_s > 60 * budget_min:
        raise UsageError(
            f"The budget of {budget_min:g} min does not hold {first.name}, {first.duration_s:g} s.",
            cause="--budget counts minutes of flight.",
            fix=f"--budget {first.duration_s / 60 + 1:.0f}, or a shorter plan",
        )
    new_folder(folder)
    flights: list[Recording] = []
    paths: list[Path] = []
    plan, left_s, upcoming = first, 60 * budget_min, None
    while True:
        path = folder / f"{len(flights) + 1}-{plan.name}.mcap"
        flights.append(_flown(talk, plan, device, profile, path, seed + len(flights)))
        paths.append(path)
        left_s -= plan.duration_s
        with saying(talk) as says:
            found = diagnose(flights, quick=quick, seed=seed, says=says)
            says("Simulating what to fly next …")
            upcoming = next_of(found, seed=seed)
        talk.show(f"After {len(flights)} flight(s): {_in_a_sentence(found, upcoming)}")
        ended = _why_to_end(found, upcoming, [p.stem.split("-", 1)[1] for p in paths], left_s)
        if ended is not None:
            break
        assert upcoming is not None
        plan = load_plan(upcoming.plan)
    model = None
    if found.fitted is not None:
        model = str(save_model(found.fitted.model, folder / "extended.json"))
    document = to_document(found, model, upcoming)
    talk.show(f"Ended: {ended}.")
    show(talk, document)
    text = diagnosis_page(found, document, flights, title=f"Diagnosis: {folder.name}")
    report = write_page(text, folder / "report.html")
    return {
        "schema": "heli3dof.auto/1",
        "folder": str(folder),
        "flights": [str(p) for p in paths],
        "ended": ended,
        "report": str(report),
        "diagnosis": document,
    }


def _why_to_end(
    found: Diagnosis, upcoming: NextExperiment | None, flown: Sequence[str], left_s: float
) -> str | None:
    from heli3dof.experiment.plan import load_plan

    if upcoming is None:
        if found.verdict in ("explained", "nothing_found"):
            return "settled"
        return f"{found.verdict.replace('_', ' ')}: no flight would tell more"
    if len(upcoming.separates) == 1 and upcoming.plan in flown:
        return f"settled, but for {upcoming.separates[0]}, which no flight so far could show"
    if load_plan(upcoming.plan).duration_s > left_s:
        return f"out of budget: {upcoming.plan} would be next"
    return None


def _in_a_sentence(found: Diagnosis, upcoming: NextExperiment | None) -> str:
    names = ", ".join(f.choice.term.name for f in found.findings)
    said = found.verdict.replace("_", " ") + (f" ({names})" if names else "")
    return said if upcoming is None else f"{said}; {upcoming.plan} would tell: {upcoming.why}"


def _flown(
    talk: Talk, plan: Plan, device: str, profile: Profile, path: Path, seed: int
) -> Recording:
    from heli3dof.cli.progress import progress
    from heli3dof.experiment.control_loop.loop import Live
    from heli3dof.experiment.fly import fly_plan

    talk.note(f"Flying {plan.name}, {plan.duration_s:g} s …")
    live = Live()
    with progress(talk, live, plan.name):
        flight = fly_plan(
            plan, device=device, profile=profile, seed=seed, output=path, live=live, warn=talk.warn
        )  # fmt: skip
    flight.raise_if_cut_short()
    return flight.recording
