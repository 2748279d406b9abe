"""Causes where no loop is known and the clock lies: the full physical model, and backwards from it.

Forward steps need a base that is nearly right, and nulls need the loop; such logs have neither. So
everything that a rig of this kind is known to have is fitted at once by the errors of free flights
(`heli3dof.identification.greybox.multistep`), and then each term is left out in turn. On the
windows of blocks that the fit has not seen, with and without term t, both refitted,

    d_k = Σ_i mean_j ρ(e_k[j, i]/s_i[j]) |without t  −  the same |with it,     Δ = mean_k d_k

Windows overlap and share their noise within `CELL_S`, so cells are drawn, not windows: t is needed
where the 95 % bootstrap interval of Δ lies above zero. The one that is needed least goes first,
and the rest is looked at again. What was left out, but serves as well in the place of one that was
kept, is tied with it. A term that is known beforehand to be there (its absence lies `KNOWN` prior
deviations away) is not asked to go; how far the recordings themselves need it is told.

That names causes; it does not choose the model. A term that these blocks do not need is not shown
to be zero: a rig of this kind has friction of some size, and another flight may need it. The model
keeps all of them, each as far from its absence as prior and recordings together have it, and is the
fit that `identify` makes. What is asked of the blocks is asked of one and the same Q: its scales s
are those of the errors that the whole model leaves, with and without a term.

A number that differs by recording shows its worth in recordings that no fit has seen, not in blocks
of one whose own number is known: such terms are judged by leaving out whole recordings, the number
re-estimated by the filter (`heli3dof.model.instants`), where there are two or more.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.identification.greybox.multistep import FAR, ROUNDS, Fitted, MultiStep, robust, search
from heli3dof.model.effects import terms
from heli3dof.model.filtering import Data
from heli3dof.model.greybox_windows import Flight, errors
from heli3dof.model.instants import follow
from heli3dof.model.rig_model import Structure

STAGES_S = ((0.25, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0),)
BLOCK_S = 6.0
WINDOW_S = 3.0
CELL_S = 3.0
FOLDS = 2
DRAWS = 2000
LEVEL = 0.95
REFIT = 3
"""Rounds of a refit from where the fit stood."""
KNOWN = 3.0
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
class Removal:
    """A term, what it costs blocks left out to do without it, and the fit of all but that term."""

    term: str
    worse: Worse
    without: Fitted
    tied_with: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Backward:
    """What is needed, with what each is worth, and what is not."""

    fit: Fitted
    """With every term"""
    kept: tuple[Removal, ...]
    """Most needed first"""
    gone: tuple[Removal, ...]
    """In the order in which they went"""
    halves: tuple[Fitted, ...] = ()
    """With every term, each fitted to the blocks of one fold alone"""


def backward(
    problem: MultiStep, found: Fitted, *, seed: int = 0, says: Says = lambda s: None
) -> Backward:
    """Which terms held-out windows need. ``found`` is the fit of ``problem``."""
    whole = found
    found = search(problem, whole.z, whole.noise, stages_s=STAGES_S)
    gone: list[tuple[str, Worse, list[str]]] = []
    proven: dict[str, Worse] = {}
    folds = refitted_folds(found, ROUNDS)
    alone = tuple(fit for fit, _ in folds)
    known = known_beforehand(problem)
    while True:
        order = by_need(found)
        doubtful = [t for t, z2 in order if t not in proven and z2 < CLEAR]
        rest = [t for t, z2 in order if t not in proven and z2 >= CLEAR]
        out = None
        for name in [*doubtful, *rest]:
            says(f"Without {name} …")
            worse = removed(found, folds, name, seed=seed)
            if not worse.kept and name not in known:
                out = name
                break
            proven[name] = worse
        if out is None:
            break
        # What needs the neighbour that went must be asked again.
        near = traded(found, out)
        proven = {k: v for k, v in proven.items() if k not in near}
        gone.append((out, worse, near))
        found = refit(found, out, rounds=ROUNDS)
        folds = refitted_folds(found)
    says("Looking for ties …")
    tied = {t: ties(found, folds, t, gone, seed) for t in proven}
    kept = [Removal(t, w, refit(whole, t), tied[t]) for t, w in proven.items()]
    kept.sort(key=lambda r: -r.worse.value)
    went = [Removal(t, w, refit(whole, t), tuple(near)) for t, w, near in gone]
    return Backward(whole, tuple(kept), tuple(went), alone)


def by_need(found: Fitted) -> list[tuple[str, float]]:
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


def swapped(found: Backward, instead: str, name: str, *, seed: int) -> Removal:
    """What it costs the whole model to take in a term that takes away what ``name`` names."""
    worse = removed(found.fit, refitted_folds(found.fit), "", seed=seed, instead=instead)
    return Removal(name, worse, refit(found.fit, "", instead))


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


def own(problem: MultiStep, j: int) -> list[int]:
    """Where the recordings' own numbers of parameter j stand."""
    b = list(problem.own).index(j)
    return [problem.n + i * len(problem.own) + b for i in range(len(problem.flights))]


def traded(found: Fitted, name: str) -> list[str]:
    """Other terms whose numbers are correlated with that one's."""
    free, C = found.structure.free, found.correlation
    mine = [j for j, f in enumerate(free) if f.term == name]
    near = {
        f.term: max(abs(C[i, j]) for i in mine)
        for j, f in enumerate(free)
        if f.term not in (None, name)
    }
    return [t for t, c in near.items() if c > TRADED and t is not None]


def removed(found: Fitted, folds: Sequence[tuple[Fitted, MultiStep]], name: str, *, seed: int,
            instead: str | None = None) -> Worse:  # fmt: skip
    """Without that term, or with ``instead`` in its place, everything refitted."""
    worse = []
    p = found.problem
    if any(v.startswith(f"{name}.") for v in p.varying) and len(p.flights) > 1:
        for i in range(len(p.flights)):
            full = only([j for j in range(len(p.flights)) if j != i], found)
            less = refit(full, name, instead)
            worse.append((foreign(less, p, i, found.scale), foreign(full, p, i, found.scale)))
    else:
        for fit, test in folds:
            less = refit(fit, name, instead)
            worse.append((cells(less, test, fit.scale), cells(fit, test, fit.scale)))
    return interval(np.concatenate([a - b for a, b in worse]), seed)


def refit(found: Fitted, name: str, instead: str | None = None, rounds: int = REFIT) -> Fitted:
    """The fit with that term left out, warm, at the same scales."""
    p = found.problem
    names = [t.name for t in found.structure.terms if t.name != name]
    if instead is not None:
        names.append(instead)
    new = restructured(p, names)
    z = moved(found, new)
    return search(new, z, found.noise, stages_s=STAGES_S, rounds=rounds, fixed=found.scale)


def restructured(p: MultiStep, names: Sequence[str]) -> MultiStep:
    """The same flights with other terms."""
    structure = Structure(p.structure.profile, terms(names))
    here = set(structure.names)
    return replace(
        p,
        structure=structure,
        varying={k: v for k, v in p.varying.items() if k in here},
    )


def moved(found: Fitted, new: MultiStep) -> np.ndarray:
    """(dim,) of ``new``: what both have stays, what is new stands at its prior."""
    old, z = found.problem, new.start.copy()
    at = {n: j for j, n in enumerate(old.structure.names)}
    for j, n in enumerate(new.structure.names):
        if n in at:
            z[j] = found.z[at[n]]
            if n in new.varying:
                z[own(new, j)] = found.z[own(old, at[n])]
    return z


def refitted_folds(found: Fitted, rounds: int = REFIT) -> list[tuple[Fitted, MultiStep]]:
    """For each fold: the fit to the blocks of the others, and its own windows."""
    problem, out = found.problem, []
    for fold in range(FOLDS):
        split = [halves(f, fold) for f in problem.flights]
        train = replace(problem, flights=tuple(a for a, _ in split))
        test = replace(problem, flights=tuple(b for _, b in split))
        fit = search(
            train, found.z, found.noise, stages_s=STAGES_S, rounds=rounds, fixed=found.scale
        )
        out.append((fit, test))
    return out


def halves(flight: Flight, fold: int) -> tuple[Flight, Flight]:
    """(to fit, to test): windows inside a block of `BLOCK_S` of the fold's, and those outside."""
    start = flight.t[flight.starts]
    stop = start + WINDOW_S
    block = np.floor(start / BLOCK_S).astype(int)
    last = np.floor((stop - 1e-9) / BLOCK_S).astype(int)
    test = (block % FOLDS == fold) & (last == block)
    train = (block % FOLDS != fold) & (last == block)
    return replace(flight, starts=flight.starts[train]), replace(flight, starts=flight.starts[test])


def cells(found: Fitted, test: MultiStep, scale: np.ndarray) -> np.ndarray:
    """(m,) mean loss of the test's windows in each cell of `CELL_S`, recording by recording."""
    there = replace(test, structure=found.structure, varying=found.problem.varying)
    each = there.errors(found.z, found.noise, STAGES_S[-1])
    return np.concatenate([by_cell(f, e, scale) for f, e in zip(there.flights, each, strict=True)])


def by_cell(flight: Flight, e: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """(m,) mean loss in each cell from a flight's errors (S, M, 3) rad."""
    loss = (robust(e / scale) ** 2).mean(axis=1).sum(axis=1)
    cell = np.floor(flight.t[flight.starts] / CELL_S).astype(int)
    return np.array([loss[cell == c].mean() for c in np.unique(cell)])


def only(which: Sequence[int], found: Fitted) -> Fitted:
    """The fit to these recordings of the problem alone."""
    p = found.problem
    part = replace(
        p,
        flights=tuple(p.flights[i] for i in which),
        data=tuple(p.data[i] for i in which),
        rows=tuple(p.rows[i] for i in which),
    )
    b = len(p.own)
    z = np.concatenate([found.z[: p.n], *(found.z[p.n + i * b : p.n + (i + 1) * b] for i in which)])
    return search(part, z, found.noise, stages_s=STAGES_S, rounds=REFIT, fixed=found.scale)


def foreign(found: Fitted, p: MultiStep, i: int, scale: np.ndarray) -> np.ndarray:
    """(m,) as `cells`, on recording i of ``p``, of which the fit knows nothing."""
    q, flight, a = found.problem, p.flights[i], found.noise
    data = from_climbs_end(p.data[i], int(np.argmax(p.rows[i] == flight.starts[0])))
    states = follow(q.structure, found.values, data, a[:3], a[3], q.varying).states
    X = np.full((len(flight.t), states.shape[1]), np.nan)
    there = p.rows[i] >= 0
    X[p.rows[i][there]] = states[there]
    ahead = np.array([max(1, round(h / flight.dt)) for h in STAGES_S[-1]])
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


def ties(
    found: Fitted, folds: Sequence[tuple[Fitted, MultiStep]], name: str,
    gone: Sequence[tuple[str, Worse, list[str]]], seed: int,
) -> tuple[str, ...]:  # fmt: skip
    """What went and serves as well in the place of that term."""
    return tuple(
        other
        for other, _, near in gone
        if name in near and removed(found, folds, name, seed=seed, instead=other).low <= 0
    )
