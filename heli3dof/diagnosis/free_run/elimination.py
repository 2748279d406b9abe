"""Causes where no loop is known and the clock lies: the full physical model, and backwards from it.

Forward steps need a base that is nearly right, and nulls need the loop; such logs have neither. So
everything that a rig of this kind is known to have is fitted at once by the errors of free flights
(`heli3dof.identification.greybox.multistep`), and then each term is left out in turn. On the
windows of blocks that the fit has not seen, with and without term t, both refitted,

    d_k = Σ_i mean_j ρ(e_k[j, i]/s_i[j]) |without t  −  the same |with it,     Δ = mean_k d_k

Windows overlap and share their noise within `CELL_S`, so cells are drawn, not windows: t is needed
where the 95 % bootstrap interval of Δ lies above zero. The one that is needed least goes first,
and the rest is looked at again. But a term without which the fits to the folds' own blocks are
worse by `STAYS` in Q does not go, though these blocks do not show it: what is asked of the others
would be asked of a model that is wrong, whose errors are any term's. What was left out, but serves
as well in the place of one that was kept, is tied with it. A term that is known beforehand to be
there (its absence lies `KNOWN` prior deviations away) is not asked to go; how far the recordings
themselves need it is told.

That names causes; it does not choose the model. A term that these blocks do not need is not shown
to be zero: a rig of this kind has friction of some size, and another flight may need it. The model
keeps all of them, each as far from its absence as prior and recordings together have it, and is the
fit that `identify` makes. What is asked of the blocks is asked of one and the same Q: its scales s
are those of the errors that the whole model leaves, with and without a term.

A number that differs by recording shows its worth in recordings that no fit has seen, not in blocks
of one whose own number is known: such terms are judged by leaving out whole recordings, the number
re-estimated by the filter (`heli3dof.model.estimation.ekf_jitter`), where there are two or more.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import erf, sqrt

import numpy as np

from heli3dof.diagnosis.free_run.refits import STAGE_S, Stand, own, refit
from heli3dof.identification.greybox.multistep import FAR, MultiStep, MultiStepFit, robust, search
from heli3dof.model.estimation.ekf_jitter import filter_jittered
from heli3dof.model.estimation.filter_data import Data
from heli3dof.model.greybox.multistep import Flight, errors
from heli3dof.parallel import parallel_map

CELL_S = 3.0
DRAWS = 2000
LEVEL = 0.95
KNOWN = 3.0
STAYS = 9.0
"""Of Q, three deviations squared"""
CLEAR = 30.0
"""(θ/σ)²: a term above it is not tried before all others have been."""
TRADED = 0.5
"""Correlation from which on a kept term may be tied with one that went."""
Says = Callable[[str], None]


@dataclass(frozen=True)
class Worse:
    """By how much held-out windows are worse without a term: Δ with its bootstrap interval."""

    value: float
    low: float
    high: float
    std: float
    positive: float
    """Share of the draws above zero"""

    @property
    def kept(self) -> bool:
        return self.low > 0


@dataclass(frozen=True, eq=False)
class Trial:
    """What it costs to do without a term."""

    worse: Worse
    fits: tuple[MultiStepFit, ...] = ()
    """Each fold's without it; none where whole recordings were left out instead"""
    beside: tuple[MultiStepFit, ...] = ()
    """The same with it"""


@dataclass(frozen=True, eq=False)
class Removal:
    """A term, and what it costs blocks left out to do without it."""

    term: str
    worse: Worse
    tied_with: tuple[str, ...] = ()
    trial: Trial | None = None


@dataclass(frozen=True, eq=False)
class Elimination:
    """What is needed, with what each is worth, and what is not."""

    fit: MultiStepFit
    """With every term"""
    begun: MultiStepFit
    """The same, settled at the scales s that all refits share"""
    kept: tuple[Removal, ...]
    """Most needed first"""
    gone: tuple[Removal, ...]
    """In the order in which they went; last, what stayed though these blocks do not show it"""
    halves: tuple[MultiStepFit, ...] = ()
    """With every term, each fitted to the blocks of one fold alone"""
    first: Stand | None = None
    last: Stand | None = None
    """``begun`` with its folds, and where nothing more could go; None where none were left out"""


def eliminate(
    problem: MultiStep, found: MultiStepFit, *, seed: int = 0, says: Says = lambda s: None
) -> Elimination:
    """Which terms held-out windows need. ``found`` is the fit of ``problem``."""
    begun = search(problem, found.z, found.noise, stages_s=(STAGE_S,))
    says("Fitting each half of the blocks …")
    first = stand = Stand.of(begun)
    gone: list[tuple[str, Worse, list[str]]] = []
    proven: dict[str, Trial] = {}
    known = known_beforehand(problem)
    while True:
        order = by_need(stand.fit)
        doubtful = [t for t, z2 in order if t not in proven and z2 < CLEAR]
        rest = [t for t, z2 in order if t not in proven and z2 >= CLEAR]
        out = None
        for name in [*doubtful, *rest]:
            says(f"Without {name} …")
            trial = removed(stand, name, seed=seed)
            if not trial.worse.kept and name not in known and costs(stand, trial) < STAYS:
                out = name
                break
            proven[name] = trial
        if out is None:
            break
        # What needs the neighbour that went must be asked again.
        near = traded(stand.fit, out)
        proven = {k: v for k, v in proven.items() if k not in near}
        gone.append((out, trial.worse, near))
        says(f"Without {out} … refitting the others")
        stand = stand.without(out, trial.fits)
    stays = [Removal(t, tried.worse, (), tried) for t, tried in proven.items()]
    kept = [r for r in stays if r.worse.kept or r.term in known]
    kept.sort(key=lambda r: -r.worse.value)
    went = [Removal(t, w, tuple(near)) for t, w, near in gone]
    went += [r for r in stays if r not in kept]
    alone = tuple(fit for fit, _ in first.folds)
    return Elimination(found, begun, tuple(kept), tuple(went), alone, first, stand)


def without_elimination(found: MultiStepFit) -> Elimination:
    """Without leaving blocks out: in the place of Δ stands how many deviations a term's numbers
    are from its absence, which the fit itself says."""
    each = [
        Removal(t, Worse(u, u - 1.96, u + 1.96, 1.0, 0.5 * (1 + erf(u / sqrt(2)))))
        for t, z2 in reversed(by_need(found))
        for u in [sqrt(z2)]
    ]
    kept = tuple(r for r in each if r.worse.kept)
    return Elimination(found, found, kept, tuple(r for r in each if not r.worse.kept))


def by_need(found: MultiStepFit) -> list[tuple[str, float]]:
    """(term, Σ (θ − null)²/σ² of its numbers), least needed first; recordings' own numbers count
    each for itself."""
    p, out = found.problem, {}
    C = np.linalg.inv(found.tangents @ found.tangents.T + p.prior)
    for t in found.structure.terms:
        z2 = 0.0
        for j, f in enumerate(found.structure.free):
            if f.term != t.name:
                continue
            null = f.inward(f.low if f.log else f.null)
            at = [j] if f.name not in p.varying else own(p, j)
            z2 += sum(float((found.z[i] - null) ** 2 / C[i, i]) for i in at)
        out[t.name] = z2
    return sorted(out.items(), key=lambda kv: kv[1])


def swapped(found: Elimination, instead: str, name: str, *, seed: int) -> Removal:
    """What it costs the whole model to take in a term that takes away what ``name`` names."""
    stand = found.first or Stand.of(found.begun)
    trial = removed(stand, "", seed=seed, instead=instead)
    return Removal(name, trial.worse, (), trial)


def tied(
    found: Elimination, causes: Sequence[Removal], *, seed: int, says: Says = lambda s: None
) -> list[Removal]:
    """The same with what went and serves as well in their place."""
    out = []
    for r in causes:
        says(f"Searching for causes confounded with {r.term} …")
        others = () if found.last is None else ties(found.last, r.term, found.gone, seed)
        out.append(replace(r, tied_with=others))
    return out


def known_beforehand(problem: MultiStep) -> set[str]:
    """Terms that the prior holds to be there."""
    out = set()
    sd = 1 / np.sqrt(np.diag(problem.prior))
    for j, f in enumerate(problem.structure.free):
        if f.term is None or f.log or f.name in problem.varying:
            continue
        if abs(problem.start[j] - f.inward(f.null)) > KNOWN * sd[j]:
            out.add(f.term)
    return out


def traded(found: MultiStepFit, name: str) -> list[str]:
    """Other terms whose numbers are correlated with that one's."""
    free, C = found.structure.free, found.correlation
    mine = [j for j, f in enumerate(free) if f.term == name]
    near = {
        f.term: max(abs(C[i, j]) for i in mine)
        for j, f in enumerate(free)
        if f.term not in (None, name)
    }
    return [t for t, c in near.items() if c > TRADED and t is not None]


def removed(stand: Stand, name: str, *, seed: int, instead: str | None = None) -> Trial:
    """Without that term, or with ``instead`` in its place, everything refitted."""
    p = stand.fit.problem
    if any(v.startswith(f"{name}.") for v in p.varying) and len(p.flights) > 1:

        def one(i: int) -> np.ndarray:
            full = stand.but(i)
            less = refit(full, name, instead)
            loss = [foreign(f, p, i, stand.fit.scale) for f in (less, full)]
            return np.asarray(loss[0] - loss[1])

        return Trial(interval(np.concatenate(parallel_map(one, len(p.flights))), seed))

    def each(i: int) -> tuple[MultiStepFit, np.ndarray]:
        fit, test = stand.folds[i]
        less = refit(fit, name, instead)
        return less, np.asarray(cells(less, test, fit.scale) - cells(fit, test, fit.scale))

    tried = parallel_map(each, len(stand.folds))
    worse = interval(np.concatenate([lost for _, lost in tried]), seed)
    return Trial(worse, tuple(fit for fit, _ in tried), tuple(fit for fit, _ in stand.folds))


def costs(stand: Stand, trial: Trial) -> float:
    """By how much the folds' fits to their own blocks are worse without the term, all together."""
    each = zip(trial.fits, stand.folds, strict=False)
    return sum(less.cost - fit.cost for less, (fit, _) in each)


def cells(found: MultiStepFit, test: MultiStep, scale: np.ndarray) -> np.ndarray:
    """(m,) mean loss of the test's windows in each cell of `CELL_S`, recording by recording."""
    there = replace(test, structure=found.structure, varying=found.problem.varying)
    each = there.errors(found.z, found.noise, STAGE_S)
    return np.concatenate([by_cell(f, e, scale) for f, e in zip(there.flights, each, strict=True)])


def by_cell(flight: Flight, e: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """(m,) mean loss in each cell from a flight's errors (S, M, 3) rad."""
    loss = (robust(e / scale) ** 2).mean(axis=1).sum(axis=1)
    cell = np.floor(flight.t[flight.starts] / CELL_S).astype(int)
    return np.array([loss[cell == c].mean() for c in np.unique(cell)])


def foreign(found: MultiStepFit, p: MultiStep, i: int, scale: np.ndarray) -> np.ndarray:
    """(m,) as `cells`, on recording i of ``p``, of which the fit knows nothing."""
    q, flight, a = found.problem, p.flights[i], found.noise
    data = from_climbs_end(p.data[i], int(np.argmax(p.rows[i] == flight.starts[0])))
    states = filter_jittered(q.structure, found.values, data, a[:3], a[3], q.varying).states
    X = np.full((len(flight.t), states.shape[1]), np.nan)
    there = p.rows[i] >= 0
    X[p.rows[i][there]] = states[there]
    ahead = np.array([max(1, round(h / flight.dt)) for h in STAGE_S])
    e = errors(q.structure, found.values, flight, X, ahead, tuple(q.varying))
    e = np.clip(np.nan_to_num(e, nan=FAR, posinf=FAR, neginf=-FAR), -FAR, FAR)
    e[..., ~flight.free] = 0.0
    return by_cell(flight, e, scale)


def from_climbs_end(data: Data, row: int) -> Data:
    """The filter starts anew there: what a climb would teach of a rig's numbers is wrong."""
    blocks: list[tuple[int, int, int]] = []
    free: list[np.ndarray] = []
    for (lead, start, stop), axes in zip(data.blocks, data.free, strict=True):
        cut = row if start + 2 < row < stop - 2 else stop
        blocks += [(lead, a, b) for a, b in ((start, cut), (cut, stop)) if b > a]
        free += [axes] * (len(blocks) - len(free))
    return replace(data, blocks=np.array(blocks, dtype=data.blocks.dtype), free=np.array(free))


def interval(lost: np.ndarray, seed: int) -> Worse:
    """Mean of (m,) cells and its bootstrap."""
    rng = np.random.default_rng([seed, 7])
    means = lost[rng.integers(0, len(lost), (DRAWS, len(lost)))].mean(axis=1)
    tail = 50 * (1 - LEVEL)
    low, high = np.percentile(means, [tail, 100 - tail])
    return Worse(
        float(lost.mean()), float(low), float(high), float(means.std()), float((means > 0).mean())
    )


def ties(stand: Stand, name: str, gone: Sequence[Removal], seed: int) -> tuple[str, ...]:
    """What went and serves as well in the place of that term."""
    near = [r.term for r in gone if name in r.tied_with]
    return tuple(
        other for other in near if removed(stand, name, seed=seed, instead=other).worse.low <= 0
    )
