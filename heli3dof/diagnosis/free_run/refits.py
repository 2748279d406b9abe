"""Refit a multi-step fit without a term, with another term, or to some windows or recordings.

A refit starts from the given fit: from its scaled parameters z, and from the derivatives D = ∂r/∂z
of its weighted residuals r. `identification.greybox.levenberg_marquardt.follow_on` then updates D
by Broyden's method. All refits keep the error scales s of the given fit, so that their costs Q are
comparable.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from heli3dof.identification.greybox.levenberg_marquardt import FRESH, LeastSquares, follow_on
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
"""Number of times that a refit may recompute D. An error of 0.1 in Q is acceptable."""
DIVERGED = 3.0
"""Least cost, relative to that before, of a refit that may have diverged. Chosen."""


@dataclass(frozen=True, eq=False)
class FitWithFolds:
    """A fit to all windows, and the fits that cross-validation needs."""

    fit: MultiStepFit
    folds: Sequence[MultiStepFit]
    """For each fold, the fit to the windows of the other folds (`folds_of`)"""

    @cached_property
    def without_recording(self) -> list[MultiStepFit]:
        """Return for each recording the fit to all others."""
        full, p = self.fit, self.fit.problem
        recording = np.repeat(np.arange(len(p.flights)), [len(f.starts) for f in p.flights])

        def one(i: int) -> MultiStepFit:
            others, at = with_recordings(p, [j for j in range(len(p.flights)) if j != i])
            return warm_fit(full, others, full.z[at], window_tangents(full, recording != i)[at])

        return parallel_map(one, len(p.flights))

    def without_term(self, name: str, fits: Sequence[MultiStepFit] = ()) -> FitWithFolds:
        """Return the fit to all windows and each fold's fit, refitted without the term ``name``.

        ``fits``: the folds' refits without this term, if they exist already.
        """
        each = fits or parallel_map(lambda k: refit(self.folds[k], name), len(self.folds))
        return FitWithFolds(refit(self.fit, name), each)


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
    """Return the fit of the problem ``new``; its search starts at the scaled parameters z (dim,).

    ``D`` (dim, R) contains the derivatives ∂r/∂z of R residuals r at the start, at least
    approximately. If D is None, the function computes it. ``fresh``: number of times that the
    search may recompute D. A residual is a prediction error divided by an RMS error. The RMS errors
    are those of the fit ``full``.
    """
    r = follow_on(least_squares(full, new), z, D, settled=SETTLED, fresh=fresh)
    return MultiStepFit(new, r.z, full.noise, full.scale, r.cost, r.tangents, r.rounds, r.settled)


def least_squares(full: MultiStepFit, p: MultiStep) -> LeastSquares:
    """Return the least-squares problem of ``p``, with noise and error scales of the fit ``full``.

    Error scales are the RMS errors by which the residuals are divided.
    """
    return least_squares_problem(p, full.noise, STAGE_S, full.scale)


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
    """Return where the fit of ``new`` starts: scaled parameters z, and D = ∂r/∂z of residuals r.

    Both are copied from the fit ``full``. A parameter that ``full`` lacks has its prior mean in z
    and NaN in D.
    """
    old, z = full.problem, new.start.copy()
    D = np.full((new.dim, full.tangents.shape[1]), np.nan)
    names = old.structure.names
    for j, n in enumerate(new.structure.names):
        if n in names:
            to, source = unknowns_of(new, j), unknowns_of(old, names.index(n))
            z[to], D[to] = full.z[source], full.tangents[source]
    return z, D


def parameter_of_unknown(p: MultiStep) -> np.ndarray:
    """Return for each element of z (dim,) the index (0 … n − 1) of the parameter it belongs to.

    z contains the n scaled parameters. For each recording, it then contains this recording's own
    values of the parameters that vary between recordings.
    """
    return np.concatenate([np.arange(p.n), np.tile(p.own, len(p.flights))])


def unknowns_of(p: MultiStep, j: int) -> np.ndarray:
    """Return where z contains parameter j: its common value, then each recording's own value.

    The result is an array of indices. Only a parameter that varies between recordings has own
    values.
    """
    return np.flatnonzero(parameter_of_unknown(p) == j)


def without_effects(p: MultiStep) -> np.ndarray:
    """Return the scaled parameters z (dim,) of a model whose terms have no effect.

    A parameter that is fitted on a logarithmic scale cannot be zero, so it cannot switch its effect
    off. For such a parameter, the result contains its lower bound.
    """
    null = np.array([f.scaled(f.low if f.log else f.null) for f in p.structure.free])
    return np.asarray(null[parameter_of_unknown(p)])


def folds_of(full: MultiStepFit) -> list[MultiStepFit]:
    """Return for each fold the fit to the windows of the other folds."""
    p = full.problem

    def one(fold: int) -> MultiStepFit:
        kept = [split_windows(f, fold)[0] for f in p.flights]
        train = with_windows(p, kept)
        fit = warm_fit(full, train, full.z, window_tangents(full, np.concatenate(kept)))
        v = least_squares(full, train)
        # Many refits and the standard deviations use these derivatives, so they are recomputed.
        D = v.tangents(fit.z, v.residuals(fit.z))
        return warm_fit(full, train, fit.z, D)

    return parallel_map(one, FOLDS)


def with_windows(p: MultiStep, kept: Sequence[np.ndarray]) -> MultiStep:
    """Return the fit problem ``p`` restricted to some of its prediction windows.

    ``kept``: for each flight an array (S,) of bool, True for each of the S windows to keep.
    """
    each = zip(p.flights, kept, strict=True)
    return replace(p, flights=tuple(replace(f, starts=f.starts[k]) for f, k in each))


def window_tangents(full: MultiStepFit, kept: np.ndarray) -> np.ndarray:
    """Return the derivatives ∂r/∂z (dim, R) of the residuals r (R,) in some prediction windows.

    z (dim,) are the fit's scaled parameters. ``kept`` (S,) bool: True for the windows to use.
    """
    each = full.tangents.reshape(len(full.z), len(kept), -1)
    return np.asarray(each[:, kept].reshape(len(full.z), -1))


def split_windows(flight: Flight, fold: int) -> tuple[np.ndarray, np.ndarray]:
    """Return (training windows, test windows) of a fold, each (S,) bool for the S windows.

    The flight is divided into blocks of `FOLD_BLOCK_S` seconds, which belong to the `FOLDS` folds
    in turn. A test window lies completely in a block of this fold. A training window lies
    completely in a block of another fold. A window that crosses the edge of a block is in neither
    set.
    """
    start = flight.t[flight.starts]
    stop = start + WINDOW_S
    block = np.floor(start / FOLD_BLOCK_S).astype(int)
    last = np.floor((stop - 1e-9) / FOLD_BLOCK_S).astype(int)
    whole, inside = last == block, block % FOLDS == fold
    return whole & ~inside, whole & inside


def with_recordings(p: MultiStep, which: Sequence[int]) -> tuple[MultiStep, np.ndarray]:
    """Return the fit problem ``p`` restricted to the recordings with the indices ``which``.

    The second result is an array of indices: which elements of the scaled parameters z of ``p`` the
    restricted problem has.
    """
    part = replace(
        p,
        flights=tuple(p.flights[i] for i in which),
        data=tuple(p.data[i] for i in which),
    )
    b = len(p.own)
    return part, np.concatenate([np.arange(p.n), *(p.n + i * b + np.arange(b) for i in which)])
