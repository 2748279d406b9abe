"""Fits next to a fit: without a term, with another, of some windows or recordings alone.

Each starts where the whole fit stands, with its tangents: of the rows and columns that both have
they are nearly the same, and `heli3dof.identification.greybox.levenberg_marquardt.follow_on` mends
them as it goes. All are weighed by the whole's own scales, so that costs compare.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from heli3dof.identification.greybox.levenberg_marquardt import FRESH, follow_on
from heli3dof.identification.greybox.multistep import (
    SETTLED,
    MultiStep,
    MultiStepFit,
    least_squares_problem,
)
from heli3dof.identification.greybox.weak_form import weak_start
from heli3dof.model.effects import terms
from heli3dof.model.greybox.multistep import Flight
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.parallel import parallel_map

STAGE_S = (0.25, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0)
BLOCK_S = 6.0
WINDOW_S = 3.0
FOLDS = 2
ANEW = 1
"""How often a refit without a term may take its tangents anew: a tenth of Q is nothing there."""
ASTRAY = 3.0
"""Times the cost: a refit that is worse may have lost its way."""


@dataclass(frozen=True, eq=False)
class Stand:
    """A fit, the same to each fold's blocks beside that fold's own windows, and (made when asked
    for) the same to all recordings but one."""

    fit: MultiStepFit
    folds: tuple[tuple[MultiStepFit, MultiStep], ...]
    _others: dict[int, MultiStepFit] = field(default_factory=dict)

    @classmethod
    def of(cls, fit: MultiStepFit) -> Stand:
        return cls(fit, tuple(folds_of(fit)))

    def but(self, i: int) -> MultiStepFit:
        """To all recordings but that one."""
        if i not in self._others:
            kept = [j for j in range(len(self.fit.problem.flights)) if j != i]
            self._others[i] = only(kept, self.fit)
        return self._others[i]

    def without(self, name: str, fits: Sequence[MultiStepFit] = ()) -> Stand:
        """All of it without that term; ``fits``: the folds' own, where they were made before."""
        each = list(fits) or parallel_map(lambda k: refit(self.folds[k][0], name), len(self.folds))
        tests = [test for _, test in self.folds]
        whole = refit(self.fit, name)
        return Stand(whole, tuple(zip(each, tests, strict=True)))


def refit(found: MultiStepFit, name: str, instead: str | None = None) -> MultiStepFit:
    """The fit with that term left out, ``instead`` in its place."""
    names = [t.name for t in found.structure.terms if t.name != name]
    if instead is not None:
        names.append(instead)
    new = restructured(found.problem, names)
    z, D = moved(found, new)
    fit = warm(found, new, z, D, ANEW)
    if fit.cost < ASTRAY * found.cost:
        return fit
    # Flights that run away have no slope to follow; the weak form lets none fly.
    other = warm(found, new, weak_start(new, z), None)
    return min(fit, other, key=lambda f: f.cost)


def warm(
    found: MultiStepFit, new: MultiStep, z: np.ndarray, D: np.ndarray | None, fresh: int = FRESH
) -> MultiStepFit:
    """The minimum of ``new`` next to ``z`` (dim,), whose tangents are about D (dim, R)."""
    v = least_squares_problem(new, found.noise, STAGE_S, found.scale)
    r = follow_on(v, z, D, settled=SETTLED, fresh=fresh)
    return MultiStepFit(new, r.z, found.noise, found.scale, r.cost, r.tangents, r.rounds, r.settled)


def restructured(p: MultiStep, names: Sequence[str]) -> MultiStep:
    """The same flights with other terms."""
    structure = Structure(p.structure.profile, terms(names))
    here = set(structure.names)
    return replace(
        p,
        structure=structure,
        varying={k: v for k, v in p.varying.items() if k in here},
    )


def moved(found: MultiStepFit, new: MultiStep) -> tuple[np.ndarray, np.ndarray]:
    """(dim,) of ``new``: what both have stays, what is new stands at its prior; and the tangents
    (dim, R), NaN for what is new."""
    old, z = found.problem, new.start.copy()
    D = np.full((new.dim, found.tangents.shape[1]), np.nan)
    at = {n: j for j, n in enumerate(old.structure.names)}
    for j, n in enumerate(new.structure.names):
        if n in at:
            z[j], D[j] = found.z[at[n]], found.tangents[at[n]]
            if n in new.varying:
                here, there = own(new, j), own(old, at[n])
                z[here], D[here] = found.z[there], found.tangents[there]
    return z, D


def own(problem: MultiStep, j: int) -> list[int]:
    """Where the recordings' own numbers of parameter j stand."""
    b = list(problem.own).index(j)
    return [problem.n + i * len(problem.own) + b for i in range(len(problem.flights))]


def folds_of(found: MultiStepFit) -> list[tuple[MultiStepFit, MultiStep]]:
    """For each fold: the fit to the others' blocks, with tangents anew, and its own windows."""
    p = found.problem

    def one(fold: int) -> tuple[MultiStepFit, MultiStep]:
        split = [halves(f, fold) for f in p.flights]
        train = replace(p, flights=tuple(a for a, _ in split))
        test = replace(p, flights=tuple(b for _, b in split))
        kept = [np.isin(f.starts, a.starts) for f, (a, _) in zip(p.flights, split, strict=True)]
        fit = warm(found, train, found.z, of_windows(found, np.concatenate(kept)))
        v = least_squares_problem(train, found.noise, STAGE_S, found.scale)
        D = v.tangents(fit.z, v.residuals(fit.z))  # many fits and a σ will rest on them
        return warm(found, train, fit.z, D), test

    return parallel_map(one, FOLDS)


def of_windows(found: MultiStepFit, kept: np.ndarray) -> np.ndarray:
    """(dim, R') the tangents of those windows (S,) bool."""
    each = found.tangents.reshape(len(found.z), len(kept), -1)
    return np.asarray(each[:, kept].reshape(len(found.z), -1))


def halves(flight: Flight, fold: int) -> tuple[Flight, Flight]:
    """(to fit, to test): windows inside a block of `BLOCK_S` of the fold's, and those outside."""
    start = flight.t[flight.starts]
    stop = start + WINDOW_S
    block = np.floor(start / BLOCK_S).astype(int)
    last = np.floor((stop - 1e-9) / BLOCK_S).astype(int)
    test = (block % FOLDS == fold) & (last == block)
    train = (block % FOLDS != fold) & (last == block)
    return replace(flight, starts=flight.starts[train]), replace(flight, starts=flight.starts[test])


def only(which: Sequence[int], found: MultiStepFit) -> MultiStepFit:
    """The fit to these recordings of the problem alone."""
    p = found.problem
    part = replace(
        p,
        flights=tuple(p.flights[i] for i in which),
        data=tuple(p.data[i] for i in which),
        rows=tuple(p.rows[i] for i in which),
    )
    b = len(p.own)
    here = np.concatenate([np.arange(p.n), *(p.n + i * b + np.arange(b) for i in which)])
    whose = np.repeat(np.arange(len(p.flights)), [len(f.starts) for f in p.flights])
    D = of_windows(found, np.isin(whose, which))
    return warm(found, part, found.z[here], D[here])
