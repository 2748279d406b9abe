"""Which plan to fly next: the one whose simulated outcome tells the tied causes apart soonest.

Each tied cause i is taken for the truth in turn, at the size that the recordings give it. Every
plan is flown on that truth in closed loop, with its process noise and encoders, and the flight is
screened for all of them from the base fit (`heli3dof.diagnosis.screen`): with z_j the score of
cause j, other parameters of the base refitted to first order,

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
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np

from heli3dof.diagnosis.catalogue import Probe, Reach, probes
from heli3dof.diagnosis.diagnose import Diagnosis
from heli3dof.diagnosis.noisy_flight import noisy_flight
from heli3dof.diagnosis.screen import Screen, screen
from heli3dof.diagnosis.select import TIE
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
SEEN = 2.0
"""|z| below which the recordings' size of a cause is worthless, and the catalogue's is taken"""
HOPELESS = 0.5
"""Certainty below which no plan is promised to settle it."""


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
    names: Sequence[str],
    *,
    plans: Sequence[str] | None = None,
    seed: int = 0,
    typical: bool = False,
) -> NextExperiment:
    """The plan that tells the causes ``names`` apart, all of them absent from ``base``.

    With ``typical`` the causes are simulated at their catalogue's size instead of the one that the
    recordings give: for what these could not show. Plans that leave the envelope on any of the
    truths are left out. Raises UsageError for an unknown name, or where no plan can be flown.
    """
    rivals = [term(n) for n in names][:MOST]
    looked = [probes(t, _reach(base)) for t in rivals]
    seen = None if typical else screen(base, [p for group in looked for p in group])
    sizes = [_typical(t) if seen is None else _size(t, seen) for t in rivals]
    truths = [_truth(base, t, v) for t, v in zip(rivals, sizes, strict=True)]
    # Each cause is looked for at the size that it has, too, not only where a search would look.
    for group, t, v in zip(looked, rivals, sizes, strict=True):
        group.append(Probe(t, v, v[0] - t.effect.parameters[0].null))
    profile = base.structure.profile.with_controller()
    flown = [load_plan(p) for p in (named_plans() if plans is None else plans)]
    jobs = [(plan, i) for plan in flown for i in range(len(truths))]
    with ThreadPoolExecutor(max_workers=2) as pool:
        margins = list(
            pool.map(lambda job: _margin(base, profile, job[0], truths, looked, job[1], seed), jobs)
        )
    outlooks = []
    for k, plan in enumerate(flown):
        mine = margins[k * len(truths) : (k + 1) * len(truths)]
        if None not in mine:
            m = tuple(float(x) for x in mine if x is not None)
            sure = float(np.mean([_chance(x) for x in m]))
            outlooks.append(Outlook(plan.name, plan.duration_s, m, sure))
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
    """The experiment that a diagnosis asks for: its first tie, or else what it could not see.

    None where nothing is open, where the data are at fault, or where no plan can be flown.
    """
    if found.verdict == "bad_data":
        return None
    base = found.base
    try:
        for finding in found.findings:
            choice = finding.choice
            if choice.tied_with:
                return recommend(base, [choice.term.name, *choice.tied_with], seed=seed)
            base = choice.fit
        if found.findings or not found.not_identifiable:
            return None
        return recommend(found.base, found.not_identifiable[:1], seed=seed, typical=True)
    except UsageError:
        return None


def _why(best: Outlook, names: Sequence[str]) -> str:
    seconds = f"{best.duration_s:.0f} s"
    if len(names) == 1:
        return (
            f"simulated, {seconds} of it show {names[0]} with a score of {best.margin:.0f} "
            f"({best.certainty * 100:.0f} % certain to be enough)"
        )
    what = " and ".join(names) if len(names) == 2 else ", ".join(names)
    said = f"simulated, {seconds} of it part {what} by a margin of {best.margin:.0f}"
    if best.certainty < HOPELESS:
        return f"{said}: more than any other plan, but hardly enough; fly it several times"
    return f"{said}, {best.certainty * 100:.0f} % certain to be enough"


def _chance(margin: float) -> float:
    """P(margin's draw > TIE), margin ~ N(m, 4 m).

    >>> _chance(6.0), round(_chance(30.0), 3), _chance(-1.0)
    (0.5, 0.986, 0.0)
    """
    if margin <= 0:
        return 0.0
    return 0.5 * (1 + math.erf((margin - TIE) / (2 * math.sqrt(2 * margin))))


def _margin(
    base: Estimate,
    profile: Profile,
    plan: Plan,
    truths: Sequence[GreyBoxModel],
    looked: Sequence[Sequence[Probe]],
    i: int,
    seed: int,
) -> float | None:
    """Of truth ``i`` over the others on a flight of the plan; None where it cannot be flown."""
    flight = _flight(profile, plan, truths[i], seed)
    if flight is None:
        return None
    runs = usable_runs(flight, 0)
    if not runs:
        return None
    seen = screen(base, [p for group in looked for p in group], data_of([flight], runs))
    Z2, at = [], 0
    for group in looked:
        Z2.append(float(np.max(seen.z[at : at + len(group)] ** 2)))
        at += len(group)
    return Z2[i] - max((z for j, z in enumerate(Z2) if j != i), default=0.0)


def _flight(profile: Profile, plan: Plan, truth: GreyBoxModel, seed: int) -> Recording | None:
    """The plan flown on the truth with its noise; None where it is refused or would trip."""
    try:
        calm = simulate(plan, truth, profile=profile, seed=seed)
    except (UsageError, CheckFailed):
        return None
    flight = noisy_flight(truth, calm, np.random.default_rng([seed, 5]))
    return flight if _inside(flight, profile) else None


def _inside(flight: Recording, profile: Profile) -> bool:
    """True where the flight's angles stay in the envelope."""
    envelope, still = Envelope(profile), (0.0, 0.0, 0.0)
    every = flight.angle[:: max(1, round(0.02 / profile.dt))]
    volts = (0.0, 0.0)
    return all(envelope.check(0.0, a, still, volts, volts) is None for a in every.tolist())


def _reach(base: Estimate) -> Reach:
    data = base.problem.data
    return Reach(float(np.nanmax(np.abs(data.V))), float(data.t[-1] - data.t[0]))


def _size(t: Term, seen: Screen) -> tuple[float, ...]:
    """The term's values as the screen of the recordings' best probe gives them."""
    best = max(
        (k for k, p in enumerate(seen.probes) if p.name == t.name), key=lambda k: abs(seen.z[k])
    )
    _, *rest = seen.probes[best].values
    first = t.effect.parameters[0]
    size = first.null + float(np.clip(seen.amplitude[best], -3 * first.typical, 3 * first.typical))
    if not (first.low < size < first.high and abs(seen.z[best]) > SEEN):
        return (_typical(t)[0], *rest)
    return (size, *rest)


def _typical(t: Term) -> tuple[float, ...]:
    """The catalogue's size, which lies on the side of absence that is possible."""
    first, *rest = t.effect.parameters
    if first.start is not None:
        return (first.start, *(p.typical for p in rest))
    size = first.typical if first.null + first.typical < first.high else -first.typical
    return (size if first.log else first.null + size, *(p.typical for p in rest))


def _truth(base: Estimate, t: Term, values: Sequence[float]) -> GreyBoxModel:
    structure = Structure(base.structure.profile, (*base.structure.terms, t))
    n = len(structure.free)
    return GreyBoxModel(
        t.name, structure.profile, tuple(x.name for x in structure.terms),
        np.concatenate([base.values, values]), base.optimum.noise[:3], np.full((n, n), np.nan),
        jitter_s=float(base.optimum.noise[3]),
    )  # fmt: skip
