"""Which plan to fly next: the one whose simulated outcome tells the tied causes apart soonest.

Each tied cause i is taken for the truth in turn, at the size that its own fit gives it. Every plan
is flown on that truth in closed loop, with its process noise and encoders, and the flight is
screened for all of them from the base fit (`screening.score_test`): with z_j the score of
cause j, other parameters of the base refitted to first order, less what it is on the same flight of
the base alone (what quantisation and feedback fake),

    margin_i = z_i² − max_{j≠i} z_j²,      margin = min_i margin_i,      rank by margin / duration

z² is twice the log-likelihood that a cause wins, so a margin is what a diagnosis of that flight
would see. Between two simple hypotheses it scatters as N(m, 4 m); the chance that it exceeds `TIE`

    certainty = mean_i Φ((m_i − TIE) / (2 √m_i))

One cause alone is held against nothing: margin = z². To first order, one flight for each truth:
good enough to choose a plan, not to promise an outcome.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.diagnosis.conclusion.encoder_scales import flyable
from heli3dof.diagnosis.estimate.evaluation import evaluate
from heli3dof.diagnosis.outlook import HOPELESS, NextExperiment, Outlook, percent
from heli3dof.diagnosis.planning.free_run_plan import next_free_flight
from heli3dof.diagnosis.planning.plan_flights import Task, fly_task, stable, task_of
from heli3dof.diagnosis.result import DOES_NOT_PAY, Diagnosis, Dropped
from heli3dof.diagnosis.screening.catalogue import Probe, probes
from heli3dof.diagnosis.screening.score_test import Screen
from heli3dof.diagnosis.selection.candidate_fits import CandidateFit
from heli3dof.diagnosis.selection.select import TIE
from heli3dof.errors import UsageError
from heli3dof.experiment.plan import load_plan, named_plans
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.method import usable_runs
from heli3dof.model.effects import Term, term
from heli3dof.model.estimation.filter_data import data_of
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.parallel import parallel_map

AT_ONCE = 2
"""Plans that are asked further before the best is sought again"""
MOST = 4
"""Tied causes that are simulated; a tie of more is told by its first ones."""


@dataclass(frozen=True)
class Cause:
    """A term at these values of its parameters (in their units)."""

    term: Term
    values: tuple[float, ...]

    @classmethod
    def fitted(cls, contender: CandidateFit) -> Cause:
        """At the size that its own fit gives it."""
        every = contender.problem.values(contender.optimum.theta)
        n = len(contender.term.effect.parameters)
        return cls(contender.term, tuple(float(v) for v in every[-n:]))

    @classmethod
    def typical(cls, name: str) -> Cause:
        """At the catalogue's size, on the side of absence that is possible. Raises UsageError."""
        t = term(name)
        first, *rest = t.effect.parameters
        size = first.typical if first.null + first.typical < first.high else -first.typical
        size = size if first.log else first.null + size
        size = size if first.start is None else first.start
        return cls(t, (size, *(p.typical for p in rest)))

    @property
    def probe(self) -> Probe:
        """Where it is, beside where a search would look for it."""
        first = self.term.effect.parameters[0]
        return Probe(self.term, self.values, self.values[0] - first.null)


def recommend(
    base: Estimate,
    causes: Sequence[Cause],
    *,
    plans: Sequence[str] | None = None,
    seed: int = 0,
) -> NextExperiment:
    """The plan that tells the causes apart, all of them absent from ``base``.

    Plans that leave the envelope on any of the truths are left out. Raises UsageError where no
    plan can be flown.
    """
    causes = list(causes)[:MOST]
    names = [c.term.name for c in causes]
    V = base.problem.data.V
    looked = [[*probes(c.term, V), c.probe] for c in causes]
    profile = base.structure.profile
    worlds = [_world(base, c) for c in (None, *causes)]
    tasks = []
    if all(stable(world, profile) for world in worlds):
        wanted = [load_plan(p) for p in (named_plans() if plans is None else plans)]
        tasks = [t for t in (task_of(plan, profile, seed) for plan in wanted) if t is not None]
    outlooks = _outlooks(base, tasks, worlds, looked)
    if not outlooks:
        raise UsageError(
            f"No plan separates {', '.join(names)} on this rig.",
            cause="every plan leaves the envelope of this profile on at least one of the models.",
            fix="widen [limits] in the profile, or write a gentler plan",
        )
    ranking = tuple(sorted(outlooks, key=lambda o: -o.margin / o.duration_s))
    best = ranking[0]
    return NextExperiment(
        best.plan, tuple(names), _why(best, names), round(best.certainty, 3), ranking
    )


def next_experiment(found: Diagnosis, *, seed: int = 0) -> NextExperiment | None:
    """The experiment that a diagnosis asks for: its first tie, what did not pay, what was not seen.

    None where nothing is open, where the data are at fault, where no plan can be flown, or where
    none would show it.
    """
    if found.fitted is not None and found.fitted.open is not None:
        return next_free_flight(found.fitted.open, seed=seed)
    if found.fitted is None or found.fitted.base is None:
        return None
    base: Estimate = found.fitted.base
    try:
        for finding in found.findings:
            best, *others = finding.choice.contenders
            if names := flyable(finding.choice.term.name, finding.choice.tied_with):
                tied = [c for c in others if c.term.name in names]
                return recommend(base, [Cause.fitted(c) for c in (best, *tied)], seed=seed)
            base = Estimate(best.problem, best.optimum)
        open_ = [_dropped(x) for x in found.dropped if x.why == DOES_NOT_PAY]
        open_ = open_ or [Cause.typical(name) for name in flyable("", found.not_identifiable)[:1]]
        if found.findings or any(o.tied_with for o in found.calibration_findings) or not open_:
            return None
        asked = recommend(base, open_[:1], seed=seed)
        return None if (asked.certainty or 0.0) < HOPELESS else asked
    except UsageError:
        return None


def _dropped(x: Dropped) -> Cause:
    """At the size that it was taken with; at the catalogue's where it was seen in passing only."""
    return Cause.typical(x.name) if x.choice is None else Cause.fitted(x.choice.contenders[0])


def _why(best: Outlook, names: Sequence[str]) -> str:
    seconds = f"{best.duration_s:.0f} s"
    if len(names) == 1:
        return (
            f"in simulation, {seconds} of it give {names[0]} a score of {best.margin:.0f} "
            f"({percent(best.certainty)} probability of a decision)"
        )
    what = " and ".join(names) if len(names) == 2 else ", ".join(names)
    text = f"in simulation, {seconds} of it separate {what} by a margin of {best.margin:.0f}"
    if best.certainty < HOPELESS:
        return f"{text}: more than any other plan, but hardly enough; fly it several times"
    return f"{text} ({percent(best.certainty)} probability of a decision)"


def _chance(margin: float) -> float:
    """P(margin's draw > TIE), margin ~ N(m, 4 m).

    >>> _chance(6.0), round(_chance(30.0), 3), _chance(-1.0)
    (0.5, 0.986, 0.0)
    """
    if margin <= 0:
        return 0.0
    return 0.5 * (1 + math.erf((margin - TIE) / (2 * math.sqrt(2 * margin))))


def _outlooks(
    base: Estimate,
    tasks: Sequence[Task],
    worlds: Sequence[GreyBoxModel],
    looked: Sequence[Sequence[Probe]],
) -> list[Outlook]:
    """Of every plan that can be flown. One that can no longer be the best is flown no further: its
    margins are those of the hardest truths, as the first plan showed them.

    ``worlds``: the base alone, then each truth.
    """
    nothing: dict[Task, np.ndarray] = {}
    margins: dict[Task, dict[int, float]] = {}

    def fly(jobs: Sequence[tuple[Task, int]]) -> None:
        """The jobs (plan, truth); those of plans that cannot be flown there strike them off."""
        first = [(t, 0) for t in dict.fromkeys(task for task, _ in jobs) if t not in nothing]
        every = [*first, *((task, i + 1) for task, i in jobs)]
        seen = parallel_map(
            lambda j: _scores(base, every[j][0], worlds[every[j][1]], looked), len(every)
        )
        cannot = {task for (task, _), z in zip(every, seen, strict=True) if z is None}
        for (task, world), z in zip(every, seen, strict=True):
            if task in cannot:
                margins.pop(task, None)
            elif z is not None and world == 0:
                nothing[task] = z
            elif z is not None:
                m = _margin(z - nothing[task], world - 1, looked)
                margins.setdefault(task, {})[world - 1] = m

    def promises(task: Task) -> float:
        """At most, by what was seen: the rank of what was flown on every truth."""
        return min(margins[task].values()) / task.plan.duration_s

    truths = list(range(len(worlds) - 1))
    waiting = list(tasks)
    while waiting and not margins:
        pilot = waiting.pop(0)
        fly([(pilot, i) for i in truths])
        truths.sort(key=lambda i: margins.get(pilot, {}).get(i, 0.0))
    fly([(task, truths[0]) for task in waiting])
    while True:
        going = sorted(margins, key=promises, reverse=True)
        best = max((promises(t) for t in going if len(margins[t]) == len(truths)), default=-np.inf)
        going = [t for t in going if len(margins[t]) < len(truths) and promises(t) > best]
        if not going:
            break
        fly([(t, i) for t in going[:AT_ONCE] for i in truths if i not in margins[t]])
    return [
        Outlook(
            task.plan.name,
            task.plan.duration_s,
            tuple(m[i] for i in sorted(m)),
            float(np.mean([_chance(v) for v in m.values()])),
        )
        for task, m in margins.items()
    ]


def _scores(
    base: Estimate, task: Task, world: GreyBoxModel, looked: Sequence[Sequence[Probe]]
) -> np.ndarray | None:
    """(P,) z of every probe on a flight of the task in that world; None where none can be flown."""
    flight = fly_task(task, world)
    runs = [] if flight is None else usable_runs(flight, 0)
    if flight is None or not runs:
        return None
    problem = replace(base.problem, data=data_of([flight], runs))
    o = base.optimum
    here = evaluate(problem, o.theta, o.noise, whole=False)
    probes = [p for group in looked for p in group]
    return Screen(problem, o.theta, here, probes).score(here, prior=False).z


def _margin(z: np.ndarray, i: int, looked: Sequence[Sequence[Probe]]) -> float:
    """Of truth ``i`` over the others, from the scores (P,) of its flight."""
    ends = np.cumsum([len(group) for group in looked])[:-1]
    best = [float(part.max()) for part in np.split(z**2, ends)]
    return best[i] - max((b for j, b in enumerate(best) if j != i), default=0.0)


def _world(base: Estimate, cause: Cause | None) -> GreyBoxModel:
    """The base with the cause in it; the base alone for None."""
    new = () if cause is None else (cause.term,)
    structure = Structure(base.structure.profile, (*base.structure.terms, *new))
    values = np.concatenate([base.values, () if cause is None else cause.values])
    return GreyBoxModel(
        "world", structure.profile, tuple(t.name for t in structure.terms), values,
        base.optimum.noise[:3], np.full((len(values), len(values)), np.nan),
        jitter_s=float(base.optimum.noise[3]),
    )  # fmt: skip
