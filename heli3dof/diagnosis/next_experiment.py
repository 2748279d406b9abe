"""Which plan to fly next: the one whose simulated outcome tells the tied causes apart soonest.

Each tied cause i is taken for the truth in turn, at the size that its own fit gives it. Every plan
is flown on that truth in closed loop, with its process noise and encoders, and the flight is
screened for all of them from the base fit (`heli3dof.diagnosis.screen`): with z_j the score of
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
from dataclasses import dataclass, field, replace

import numpy as np

from heli3dof.diagnosis.catalogue import Probe, probes
from heli3dof.diagnosis.corrected import look
from heli3dof.diagnosis.noisy_flight import noisy_flight
from heli3dof.diagnosis.result import DOES_NOT_PAY, Diagnosis
from heli3dof.diagnosis.screen import Screen
from heli3dof.diagnosis.select import TIE, Contender
from heli3dof.diagnosis.workers import in_threads
from heli3dof.errors import CheckFailed, UsageError
from heli3dof.experiment.plan import Plan, load_plan, named_plans
from heli3dof.experiment.simulate import simulate
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.method import usable_runs
from heli3dof.model.effects import Term, term
from heli3dof.model.filtering import data_of
from heli3dof.model.greybox import GreyBoxModel
from heli3dof.model.rig_model import Structure
from heli3dof.recording.recording import Recording
from heli3dof.rig.envelope import Envelope
from heli3dof.rig.profile import Profile

MOST = 4
"""Tied causes that are simulated; a tie of more is told by its first ones."""
HOPELESS = 0.5
"""Certainty below which no plan is promised to settle it."""


@dataclass(frozen=True)
class Cause:
    """A term at these values of its parameters (in their units)."""

    term: Term
    values: tuple[float, ...]

    @classmethod
    def fitted(cls, contender: Contender) -> Cause:
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


@dataclass(frozen=True)
class Outlook:
    """What one plan would show: margins of each truth (the unit of 2 ln L), and the chance."""

    plan: str
    duration_s: float
    margins: tuple[float, ...]
    certainty: float

    @property
    def margin(self) -> float:
        return min(self.margins)


@dataclass(frozen=True)
class NextExperiment:
    """The plan to fly, what it separates, the chance that it does, and all plans, best first."""

    plan: str
    separates: tuple[str, ...]
    why: str
    certainty: float | None
    ranking: tuple[Outlook, ...] = field(default=())


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
    flown = [load_plan(p) for p in (named_plans() if plans is None else plans)]
    profile = base.structure.profile.with_controller()
    worlds = [_world(base, c) for c in (None, *causes)]
    jobs = [(plan, world) for plan in flown for world in worlds]
    every = in_threads(lambda j: _scores(base, profile, *jobs[j], looked, seed), len(jobs))
    outlooks = []
    for k, plan in enumerate(flown):
        nothing, *seen = every[k * len(worlds) : (k + 1) * len(worlds)]
        if nothing is None or any(z is None for z in seen):
            continue
        margins = _margins([z - nothing for z in seen if z is not None], looked)
        sure = float(np.mean([_chance(m) for m in margins]))
        outlooks.append(Outlook(plan.name, plan.duration_s, margins, sure))
    if not outlooks:
        raise UsageError(
            f"No plan can be flown to separate {', '.join(names)}.",
            cause="every plan leaves the envelope of this profile, on one of the models at least.",
            fix="widen [limits] in the profile, or write a gentler plan",
        )
    ranking = tuple(sorted(outlooks, key=lambda o: -o.margin / o.duration_s))
    best = ranking[0]
    return NextExperiment(
        best.plan, tuple(names), _why(best, names), round(best.certainty, 3), ranking
    )


def next_of(found: Diagnosis, *, seed: int = 0) -> NextExperiment | None:
    """The experiment that a diagnosis asks for: its first tie, what did not pay, what was not seen.

    None where nothing is open, where the data are at fault, where no plan can be flown, or where
    none would show it.
    """
    if found.fitted is None or found.fitted.base is None:
        return None
    base: Estimate = found.fitted.base
    try:
        for finding in found.findings:
            best, *others = finding.choice.contenders
            if finding.choice.tied_with:
                tied = [c for c in others if c.term.name in finding.choice.tied_with]
                return recommend(base, [Cause.fitted(c) for c in (best, *tied)], seed=seed)
            base = Estimate(best.problem, best.optimum)
        open_ = [x.name for x in found.dropped if x.why == DOES_NOT_PAY] or list(
            found.not_identifiable
        )
        if found.findings or any(o.tied_with for o in found.calibration_findings) or not open_:
            return None
        asked = recommend(base, [Cause.typical(open_[0])], seed=seed)
        return None if (asked.certainty or 0.0) < HOPELESS else asked
    except UsageError:
        return None


def _why(best: Outlook, names: Sequence[str]) -> str:
    seconds = f"{best.duration_s:.0f} s"
    if len(names) == 1:
        return (
            f"simulated, {seconds} of it show {names[0]} with a score of {best.margin:.0f} "
            f"({_percent(best.certainty)} certain to be enough)"
        )
    what = " and ".join(names) if len(names) == 2 else ", ".join(names)
    said = f"simulated, {seconds} of it part {what} by a margin of {best.margin:.0f}"
    if best.certainty < HOPELESS:
        return f"{said}: more than any other plan, but hardly enough; fly it several times"
    return f"{said}, {_percent(best.certainty)} certain to be enough"


def _percent(chance: float) -> str:
    """Never 100 %: it is a forecast."""
    return "> 99 %" if chance > 0.99 else f"{chance * 100:.0f} %"


def _chance(margin: float) -> float:
    """P(margin's draw > TIE), margin ~ N(m, 4 m).

    >>> _chance(6.0), round(_chance(30.0), 3), _chance(-1.0)
    (0.5, 0.986, 0.0)
    """
    if margin <= 0:
        return 0.0
    return 0.5 * (1 + math.erf((margin - TIE) / (2 * math.sqrt(2 * margin))))


def _scores(
    base: Estimate,
    profile: Profile,
    plan: Plan,
    world: GreyBoxModel,
    looked: Sequence[Sequence[Probe]],
    seed: int,
) -> np.ndarray | None:
    """(P,) z of every probe on a flight of the plan in that world; None where none can be flown."""
    flight = _flight(profile, plan, world, seed)
    runs = [] if flight is None else usable_runs(flight, 0)
    if flight is None or not runs:
        return None
    problem = replace(base.problem, data=data_of([flight], runs))
    o = base.optimum
    here = look(problem, o.theta, o.noise, whole=False)
    probes = [p for group in looked for p in group]
    return Screen(problem, o.theta, here, probes).see(here, prior=False).z


def _margins(seen: Sequence[np.ndarray], looked: Sequence[Sequence[Probe]]) -> tuple[float, ...]:
    """Of each truth over the others, from the scores (P,) of each truth's flight."""
    ends = np.cumsum([len(group) for group in looked])[:-1]
    out = []
    for i, z in enumerate(seen):
        best = [float(part.max()) for part in np.split(z**2, ends)]
        out.append(best[i] - max((b for j, b in enumerate(best) if j != i), default=0.0))
    return tuple(out)


def _flight(profile: Profile, plan: Plan, world: GreyBoxModel, seed: int) -> Recording | None:
    """The plan flown in that world with its noise; None where it is refused or would trip."""
    try:
        calm = simulate(plan, world, profile=profile, seed=seed)
    except (UsageError, CheckFailed):
        return None
    flight = noisy_flight(world, calm, np.random.default_rng([seed, 5]))
    return flight if _inside(flight, profile) else None


def _inside(flight: Recording, profile: Profile) -> bool:
    """True where the flight's angles stay in the envelope."""
    envelope, still = Envelope(profile), (0.0, 0.0, 0.0)
    every = flight.angle[:: max(1, round(0.02 / profile.dt))]
    volts = (0.0, 0.0)
    return all(envelope.check(0.0, a, still, volts, volts) is None for a in every.tolist())


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
