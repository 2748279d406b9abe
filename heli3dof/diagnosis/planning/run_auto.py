"""Fly a plan, diagnose, fly the recommended plan, until no further flight is recommended.

    fly a plan → diagnose all flights so far → is no further flight recommended? end
               ↑______________ fly the recommended plan ______________|

The run also ends in three other cases:

- The recommended plan exceeds the remaining budget.
- A flight has the same samples as an earlier one, because the emulated rig has a fixed seed.
- The recommended plan should show whether the rig has one particular cause, but a flight of this
  plan has already left this open.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from heli3dof.diagnosis import diagnose
from heli3dof.diagnosis.planning import next_experiment
from heli3dof.diagnosis.result import by_gain
from heli3dof.errors import OutputExists, UsageError
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import Plan, load_plan
from heli3dof.recording.atomic_write import file_name, new_folder
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import Profile, default_profile

if TYPE_CHECKING:
    from heli3dof.diagnosis.result import Diagnosis, NextExperiment

Message = Callable[[str], None]
Fly = Callable[[Plan, Path, int], Recording]


@dataclass(frozen=True, repr=False)
class AutoResult:
    """The flights of an automatic run and the diagnosis of all of them."""

    folder: Path
    paths: tuple[Path, ...]
    recordings: tuple[Recording, ...]
    diagnosis: Diagnosis
    next_experiment: NextExperiment | None
    ended: str
    """Why the run ended"""

    def __repr__(self) -> str:
        return (
            f"<AutoResult: {len(self.paths)} flight(s) in {self.folder},\n"
            f" {_sentence(self.diagnosis, self.next_experiment)};\n"
            f" ended: {self.ended}>"
        )


def run_auto(
    first: Plan | str = "rich",
    *,
    device: str,
    profile: Profile | None = None,
    folder: str | Path,
    budget_min: float = 10.0,
    quick: bool = False,
    seed: int = 0,
    fly: Fly | None = None,
    diagnosing: Callable[[], AbstractContextManager[Message]] = lambda: nullcontext(_discard),
    each: Message = lambda sentence: None,
) -> AutoResult:
    """Fly and diagnose until no further flight is recommended, or the budget is spent.

    ``folder`` is created for the recordings. ``budget_min``: minutes of flight. ``fly`` (plan,
    path, seed) replaces the function that flies a plan and writes the recording. ``diagnosing`` is
    a context for each diagnosis and yields a function that shows its progress. ``each`` receives a
    sentence after each diagnosis.

    Raises UsageError if the first plan exceeds the budget, OutputExists if the folder exists, and
    the errors of a flight.
    """
    first = load_plan(first) if isinstance(first, str) else first
    folder, rig = Path(folder), profile or default_profile()
    if first.duration_s > 60 * budget_min:
        raise UsageError(
            f"{first.name} lasts {first.duration_s:g} s, more than the budget of "
            f"{budget_min:g} min.",
            cause="the budget counts minutes of flight.",
            fix=f"--budget-min {first.duration_s / 60 + 1:.0f}, or a shorter plan",
        )
    if folder.exists():
        raise OutputExists(
            f"{folder} exists and was left as it is.",
            cause="an automatic run writes its flights to a new folder.",
            fix="another name with -o",
        )
    new_folder(folder)

    def fly_on_rig(plan: Plan, path: Path, seed: int) -> Recording:
        flight = fly_plan(plan, device=device, profile=rig, seed=seed, output=path)
        flight.raise_if_cut_short()
        return flight.recording

    recordings: list[Recording] = []
    paths: list[Path] = []
    plan, left_s = first, 60 * budget_min
    ended: str | None = None
    while True:
        path = folder / f"{len(paths) + 1}-{file_name(plan.name)}.mcap"
        recording = (fly or fly_on_rig)(plan, path, seed + len(paths))
        if any(recording.digest == r.digest for r in recordings):
            ended = f"{plan.name} repeated the samples of an earlier flight (a fixed seed)"
            break
        recordings.append(recording)
        paths.append(path)
        left_s -= plan.duration_s
        with diagnosing() as progress:
            result = diagnose.diagnose(recordings, quick=quick, seed=seed, progress=progress)
            progress("Simulating candidates for the next flight …")
            upcoming = next_experiment.next_experiment(result, seed=seed)
        each(f"After {len(paths)} flight(s): {_sentence(result, upcoming)}")
        ended = _why_ended(result, upcoming, [p.stem.split("-", 1)[1] for p in paths], left_s)
        if ended is not None:
            break
        assert upcoming is not None
        assert upcoming.plan is not None
        plan = load_plan(upcoming.plan)
    return AutoResult(folder, tuple(paths), tuple(recordings), result, upcoming, ended)


def _why_ended(
    result: Diagnosis, upcoming: NextExperiment | None, flown: Sequence[str], left_s: float
) -> str | None:
    if upcoming is None or upcoming.plan is None:
        if result.verdict in ("explained", "nothing_found"):
            return "settled"
        return f"{result.verdict.replace('_', ' ')}: no further flight would help"
    if len(upcoming.separates) == 1 and upcoming.plan in flown:
        return f"settled, except for {upcoming.separates[0]}, which no flight so far could show"
    if load_plan(upcoming.plan).duration_s > left_s:
        return f"out of budget: {upcoming.plan} would be next"
    return None


def _sentence(result: Diagnosis, upcoming: NextExperiment | None) -> str:
    names = ", ".join(f.term.name for f in by_gain(result.findings))
    verdict = result.verdict.replace("_", " ") + (f" ({names})" if names else "")
    if upcoming is None:
        return verdict
    return f"{verdict}; next: {upcoming.plan or 'no flight'}, {upcoming.why}"


def _discard(sentence: str) -> None:
    """Show no progress."""
