"""Refit a multi-step fit without a term, with another term, or to some windows or recordings.

Each refit starts at the given fit, with its scaled parameters z and its tangents D = ∂r/∂z, where r
are the weighted residuals. `identification.greybox.levenberg_marquardt.follow_on` then updates D
(Broyden). All refits keep the given fit's error scales s, so that their costs Q are comparable.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from heli3dof.identification.greybox.levenberg_marquardt import FRESH, follow_on
from heli3dof.identification.greybox.multistep import (
    SETTLED,
    STAGES_S,
    WINDOW_S,
    MultiStep,
    MultiStepFit,
    least_squares_problem,
)
from heli3dof.identification.greybox.weak_form import weak_start
from heli3dof.model.effects import terms
from heli3dof.model.greybox.prediction import Flight
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.parallel import parallel_map

STAGE_S = STAGES_S[-1]
FOLD_BLOCK_S = 2 * WINDOW_S
"""s: prediction horizons, and length of a fold's blocks. Chosen."""
FOLDS = 2
RECOMPUTATIONS = 1
"""Number of times that a refit may recompute its tangents. An error of 0.1 in Q is acceptable."""
DIVERGED = 3.0
"""Least cost, relative to that before, of a refit that may have diverged. Chosen."""


@dataclass(frozen=True, eq=False)
class FitWithFolds:
    """A fit to all windows, and the fits that cross-validation needs."""

    fit: MultiStepFit
    folds: tuple[tuple[MultiStepFit, MultiStep], ...]
    """For each fold: the fit to the other folds' windows, and the problem of its test windows"""
    _without_recording: dict[int, MultiStepFit] = field(default_factory=dict)

    @classmethod
    def of(cls, fit: MultiStepFit) -> FitWithFolds:
        return cls(fit, tuple(folds_of(fit)))

    def without_recording(self, i: int) -> MultiStepFit:
        """Return the fit to all recordings except the one with index ``i`` (from 0)."""
        if i not in self._without_recording:
            kept = [j for j in range(len(self.fit.problem.flights)) if j != i]
            self._without_recording[i] = fit_to_recordings(kept, self.fit)
        return self._without_recording[i]

    def without_term(self, name: str, fits: Sequence[MultiStepFit] = ()) -> FitWithFolds:
        """Return the fit to all windows and each fold's fit, refitted without the term ``name``.

        ``fits``: the folds' refits without this term, if they exist already.
        """
        each = list(fits) or parallel_map(lambda k: refit(self.folds[k][0], name), len(self.folds))
        tests = [test for _, test in self.folds]
        whole = refit(self.fit, name)
        return FitWithFolds(whole, tuple(zip(each, tests, strict=True)))


def refit(full: MultiStepFit, name: str, instead: str | None = None) -> MultiStepFit:
    """Return a refit of ``full`` without the term ``name``; ``instead``: a term to add.

    If ``name`` is empty, no term is removed.
    """
    names = [t.name for t in full.structure.terms if t.name != name]
    if instead is not None:
        names.append(instead)
    new = restructured(full.problem, names)
    z, D = carried_over(full, new)
    fit = warm_fit(full, new, z, D, RECOMPUTATIONS)
    if fit.cost < DIVERGED * full.cost:
        return fit
    # A diverged simulation has no useful gradient. The weak form needs no simulation.
    other = warm_fit(full, new, weak_start(new, z), None)
    return min(fit, other, key=lambda f: f.cost)


def warm_fit(
    full: MultiStepFit, new: MultiStep, z: np.ndarray, D: np.ndarray | None, fresh: int = FRESH
) -> MultiStepFit:
    """Return the fit of ``new``, started from z (dim,) and D = ∂r/∂z (dim, R).

    z are the scaled parameters, r (R,) the residuals. The error scales are those of ``full``.
    ``fresh``: number of times D may be recomputed. If D is None, it is computed at z.
    """
    v = least_squares_problem(new, full.noise, STAGE_S, full.scale)
    r = follow_on(v, z, D, settled=SETTLED, fresh=fresh)
    return MultiStepFit(new, r.z, full.noise, full.scale, r.cost, r.tangents, r.rounds, r.settled)


def restructured(p: MultiStep, names: Sequence[str]) -> MultiStep:
    """Return the fitting problem ``p`` with the terms ``names`` in place of its own terms."""
    structure = Structure(p.structure.profile, terms(names))
    parameters = set(structure.names)
    return replace(
        p,
        structure=structure,
        varying={k: v for k, v in p.varying.items() if k in parameters},
    )


def carried_over(full: MultiStepFit, new: MultiStep) -> tuple[np.ndarray, np.ndarray]:
    """Return the start of the fit ``new``: scaled parameters z, derivatives D of residuals by z.

    A parameter that the fit ``full`` lacks has its prior mean in z and NaN in D.
    """
    old, z = full.problem, new.start.copy()
    D = np.full((new.dim, full.tangents.shape[1]), np.nan)
    at = {n: j for j, n in enumerate(old.structure.names)}
    for j, n in enumerate(new.structure.names):
        if n in at:
            z[j], D[j] = full.z[at[n]], full.tangents[at[n]]
            if n in new.varying:
                to, source = recording_indices(new, j), recording_indices(old, at[n])
                z[to], D[to] = full.z[source], full.tangents[source]
    return z, D


def recording_indices(problem: MultiStep, j: int) -> list[int]:
    """Return the indices of parameter j's values, one per recording, in the scaled parameters z."""
    b = list(problem.own).index(j)
    return [problem.n + i * len(problem.own) + b for i in range(len(problem.flights))]


def folds_of(full: MultiStepFit) -> list[tuple[MultiStepFit, MultiStep]]:
    """Return for each fold the fit to the other folds' windows, and its test windows."""
    p = full.problem

    def one(fold: int) -> tuple[MultiStepFit, MultiStep]:
        split = [split_windows(f, fold) for f in p.flights]
        train = replace(p, flights=tuple(a for a, _ in split))
        test = replace(p, flights=tuple(b for _, b in split))
        kept = [np.isin(f.starts, a.starts) for f, (a, _) in zip(p.flights, split, strict=True)]
        fit = warm_fit(full, train, full.z, window_tangents(full, np.concatenate(kept)))
        v = least_squares_problem(train, full.noise, STAGE_S, full.scale)
        # Many refits and the standard deviations use these tangents, so they are recomputed.
        D = v.tangents(fit.z, v.residuals(fit.z))
        return warm_fit(full, train, fit.z, D), test

    return parallel_map(one, FOLDS)


def window_tangents(full: MultiStepFit, kept: np.ndarray) -> np.ndarray:
    """Return the derivatives ∂r/∂z (dim, R) of the R residuals r in some prediction windows.

    z are the fit's scaled parameters. ``kept`` (S,), bool: the windows to keep.
    """
    each = full.tangents.reshape(len(full.z), len(kept), -1)
    return np.asarray(each[:, kept].reshape(len(full.z), -1))


def split_windows(flight: Flight, fold: int) -> tuple[Flight, Flight]:
    """Return (training windows outside the fold's blocks, test windows inside).

    Windows that cross the edge of a block are omitted.
    """
    start = flight.t[flight.starts]
    stop = start + WINDOW_S
    block = np.floor(start / FOLD_BLOCK_S).astype(int)
    last = np.floor((stop - 1e-9) / FOLD_BLOCK_S).astype(int)
    test = (block % FOLDS == fold) & (last == block)
    train = (block % FOLDS != fold) & (last == block)
    return replace(flight, starts=flight.starts[train]), replace(flight, starts=flight.starts[test])


def fit_to_recordings(which: Sequence[int], full: MultiStepFit) -> MultiStepFit:
    """Return the fit to the recordings with the indices ``which`` alone."""
    p = full.problem
    part = replace(
        p,
        flights=tuple(p.flights[i] for i in which),
        data=tuple(p.data[i] for i in which),
    )
    b = len(p.own)
    at = np.concatenate([np.arange(p.n), *(p.n + i * b + np.arange(b) for i in which)])
    recording = np.repeat(np.arange(len(p.flights)), [len(f.starts) for f in p.flights])
    D = window_tangents(full, np.isin(recording, which))
    return warm_fit(full, part, full.z[at], D[at])
