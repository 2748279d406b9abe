"""Backward elimination with block cross-validation, for logs without a usable likelihood.

The fit of the model with all terms minimises its free-run prediction errors
(`heli3dof.identification.greybox.multistep`). Then each term is left out once, and the others are
refitted. e[k, j, i] (rad) is the error of prediction k at horizon j on axis i. s is the RMS of e in
the model with all terms, for each horizon and axis. ρ is the robust loss. Held-out flights are
divided into time intervals of `WINDOW_S`, the cells. The mean loss of the predictions k that start
in cell c increases by

    d_c = mean_{k∈c} Σ_i mean_j [ρ(e_without/s) − ρ(e_with/s)],       Δ = mean_c d_c

Prediction windows overlap, so the bootstrap resamples whole cells (block bootstrap).

1. The terms are tested, the least significant first. A term stays if one of these applies; the
   first term to which none applies is removed:

   - Need: the bootstrap interval of Δ on held-out blocks (confidence `constants.LEVEL`) lies above
     zero.
   - Prior knowledge: the prior mean is more than `SIGMAS_997` prior standard deviations from the
     null value, at which the term has no effect.
   - Training cost: without the term, the cost Q of the multi-step fit on the training blocks
     increases by `SIGMAS_997`² or more. The model without such a term is wrong. Tests of the other
     terms in this model would be invalid.
2. The model is refitted without the removed term. Terms correlated with it are tested again.
3. `free_run.cause_selection` selects the causes among the terms that stay by need or prior
   knowledge. An effect of the catalogue is confounded with a cause (`tied_with`) if the effect can
   replace the cause without a significant increase of the loss. `free_run.candidates` lists the
   effects to try.

Some terms have a separate value for each recording. If there are several recordings, such a term is
tested on whole recordings, each held out once. The filter (`heli3dof.model.estimation.ekf_jitter`)
estimates the term's value in the held-out recording.

A term that does not improve held-out predictions need not be zero. So the elimination selects
causes only; the extended model keeps all terms, with their priors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import sqrt
from statistics import NormalDist

import numpy as np

from heli3dof.diagnosis.constants import QUANTILE_975, SIGMAS_997
from heli3dof.diagnosis.free_run.candidates import CORRELATED, possible_replacements, score_tests
from heli3dof.diagnosis.free_run.refits import (
    STAGE_S,
    FitWithFolds,
    folds_of,
    parameter_of_unknown,
    refit,
    split_windows,
    with_windows,
    without_effects,
)
from heli3dof.diagnosis.validation.gain import DRAWS, Interval, interval
from heli3dof.diagnosis.validation.prediction import with_blocks
from heli3dof.identification.greybox.multistep import (
    FAR,
    WINDOW_S,
    MultiStep,
    MultiStepFit,
    robust,
    search,
)
from heli3dof.model.estimation.ekf_jitter import filter_jittered
from heli3dof.model.estimation.filter_data import Data
from heli3dof.model.greybox.prediction import Flight, errors
from heli3dof.parallel import parallel_map
from heli3dof.stage_clock import Progress

NORMAL = NormalDist()


@dataclass(frozen=True)
class LossIncrease(Interval):
    """Increase Δ of the loss on held-out data when a term is left out, with bootstrap interval."""

    std: float
    positive: float
    """Share of the draws above zero"""

    @property
    def significant(self) -> bool:
        return self.low > 0


@dataclass(frozen=True, eq=False)
class TermResult:
    """A term, and the result of leaving it out or of replacing it by another."""

    term: str
    increase: LossIncrease
    """Increase of the loss on held-out data"""
    fits: tuple[tuple[MultiStepFit, MultiStepFit], ...] = ()
    """For each fold: (without, with) the term; empty if whole recordings were left out"""
    tied_with: tuple[str, ...] = ()
    """Effects confounded with the cause"""

    @property
    def training_cost(self) -> float:
        """Return by how much the cost Q on the training blocks is larger without the term.

        The result is a sum over the folds; 0 if there are no ``fits``.
        """
        return sum(less.cost - fit.cost for less, fit in self.fits)


@dataclass(frozen=True, eq=False)
class Elimination:
    """The result of a backward elimination."""

    fit: MultiStepFit
    """The fit with every term"""
    needed: tuple[TermResult, ...]
    """Terms that held-out data need, or that the prior alone shows to exist, by falling Δ"""

    removed: tuple[TermResult, ...]
    """The removed terms in order, then those that only the cost on training blocks retained"""
    first: FitWithFolds
    last: FitWithFolds
    """Fits with every term (``first``) and after the last removal (``last``). Without
    cross-validation they have no folds. All refits share the error scales s of ``first``."""

    @property
    def halves(self) -> Sequence[MultiStepFit]:
        """Return one fit per fold: the model with all terms, fitted to the fold's training blocks.

        There are two folds, so the training blocks of each are half of the data.
        """
        return self.first.folds


def eliminate(
    full: MultiStepFit, *, seed: int = 0, progress: Progress = lambda s: None
) -> Elimination:
    """Return which terms of the fit ``full`` remain after backward elimination (see the module)."""
    at_common_scale = search(full.problem, full.z, full.noise, stages_s=(STAGE_S,))
    progress("Fitting each half of the blocks …")
    first = current = FitWithFolds(at_common_scale, folds_of(at_common_scale))
    removed: list[TermResult] = []
    retained: dict[str, TermResult] = {}
    known = known_beforehand(full.problem)
    while True:
        untested = [t for t, _ in by_significance(current.fit) if t not in retained]
        for k, name in enumerate(untested, 1):
            progress(f"Without {name} ({k} of up to {len(untested)}) …")
            trial = without_term(current, name, seed=seed)
            is_needed = trial.increase.significant or name in known
            if not is_needed and trial.training_cost < SIGMAS_997**2:
                break
            retained[name] = trial
        else:
            break
        correlated = correlated_terms(current.fit, name)
        retained = {k: v for k, v in retained.items() if k not in correlated}
        removed.append(TermResult(name, trial.increase))
        progress(f"Without {name} … refitting the others")
        current = current.without_term(name, [less for less, _ in trial.fits])
    needed = [r for r in retained.values() if r.increase.significant or r.term in known]
    needed.sort(key=lambda r: -r.increase.value)
    removed += [r for r in retained.values() if r not in needed]
    return Elimination(full, tuple(needed), tuple(removed), first, current)


def without_elimination(full: MultiStepFit) -> Elimination:
    """Return a result for the fit ``full`` without eliminating terms and without cross-validation.

    Cross-validation would compute by how much the held-out loss increases without a term. Here, the
    ``increase`` of a term contains its significance √(Σ ((θ − θ_0)/σ)²) instead. The sum is over
    the term's parameters, each estimated as θ ± σ; θ_0 is the value without the effect. A term with
    a significance above `QUANTILE_975` counts as needed, any other term as removed.
    """
    each = [
        TermResult(t, LossIncrease(u, u - QUANTILE_975, u + QUANTILE_975, 1.0, NORMAL.cdf(u)))
        for t, z2 in reversed(by_significance(full))
        for u in [sqrt(z2)]
    ]
    needed = tuple(r for r in each if r.increase.significant)
    removed = tuple(r for r in each if not r.increase.significant)
    alone = FitWithFolds(full, ())
    return Elimination(full, needed, removed, alone, alone)


def by_significance(full: MultiStepFit) -> list[tuple[str, float]]:
    """Return (term, Σ (θ − θ_0)²/σ²) for each term, the smallest sum first.

    The sum is over the term's parameters θ ± σ. θ_0 is the value at which the term has no effect.
    For a parameter on a logarithmic scale, θ_0 is the parameter's lower bound.
    """
    p = full.problem
    u2 = (full.z - without_effects(p)) ** 2 / np.diag(full.scaled_covariance)
    u2[p.own] = 0.0  # if a parameter has a value for each recording, only these values count
    term = np.array([full.structure.free[j].term or "" for j in parameter_of_unknown(p)])
    sums = {t.name: float(u2[term == t.name].sum()) for t in full.structure.terms}
    return sorted(sums.items(), key=lambda kv: kv[1])


def with_confounded_terms(
    result: Elimination,
    causes: Sequence[TermResult],
    *,
    seed: int,
    progress: Progress = lambda s: None,
) -> list[TermResult]:
    """Return the causes; the ``tied_with`` of each contains the effects that can replace it.

    To test whether an effect can replace a cause, the model is refitted with this effect in place
    of the cause. With cross-validation, the effect can replace the cause if the loss on held-out
    data does not increase significantly. Without cross-validation, it can replace the cause if the
    cost Q of the fit to all data increases by less than `SIGMAS_997`².
    """
    fit = result.last.fit
    progress("Testing the other effects of the catalogue …")
    tests = score_tests(fit)

    def replaces(other: str, name: str) -> bool:
        if not result.halves:
            return refit(fit, name, other).cost - fit.cost < SIGMAS_997**2
        return without_term(result.last, name, seed=seed, instead=other).increase.low <= 0

    out = []
    for r in causes:
        progress(f"Searching for causes confounded with {r.term} …")
        others = possible_replacements(fit, r.term, tests)
        out.append(replace(r, tied_with=tuple(n for n in others if replaces(n, r.term))))
    return out


def known_beforehand(problem: MultiStep) -> set[str]:
    """Return the terms that the prior alone shows to exist, before any recording is used.

    Such a term has a parameter whose prior mean is far from its null value, at which the term has
    no effect. The distance is more than `SIGMAS_997` standard deviations of the prior. Parameters
    on a logarithmic scale, or with a separate value for each recording, are ignored.
    """
    u = (problem.start - without_effects(problem)) * np.sqrt(np.diag(problem.prior))
    return {
        f.term
        for f, far in zip(problem.structure.free, np.abs(u) > SIGMAS_997, strict=False)
        if far and f.term is not None and not f.log and f.name not in problem.varying
    }


def correlated_terms(full: MultiStepFit, name: str) -> list[str]:
    """Return the terms whose estimates are correlated with those of the term ``name``.

    Two terms are correlated if a parameter of one and a parameter of the other have estimates with
    a |correlation| above `CORRELATED`.
    """
    free, C = full.structure.free, full.correlation
    at = [j for j, f in enumerate(free) if f.term == name]
    largest = {
        f.term: max(abs(C[i, j]) for i in at)
        for j, f in enumerate(free)
        if f.term not in (None, name)
    }
    return [t for t, c in largest.items() if c > CORRELATED and t is not None]


def without_term(
    current: FitWithFolds, name: str, *, seed: int, instead: str | None = None
) -> TermResult:
    """Return the result of leaving out term ``name``, or of replacing it by term ``instead``.

    The result contains the increase of the held-out loss. Each fold is held out once. If the term
    has a separate value for each of several recordings, each recording is held out once instead.
    """
    p, scale = current.fit.problem, current.fit.scale
    by_recording = any(v.startswith(f"{name}.") for v in p.varying) and len(p.flights) > 1
    fits = current.without_recording if by_recording else current.folds
    losses = recording_losses if by_recording else fold_losses

    def one(i: int) -> tuple[MultiStepFit, np.ndarray]:
        less = refit(fits[i], name, instead)
        return less, losses(less, p, i, scale) - losses(fits[i], p, i, scale)

    less, increases = zip(*parallel_map(one, len(fits)), strict=True)
    increase = bootstrap(np.concatenate(increases), seed)
    return TermResult(name, increase, () if by_recording else tuple(zip(less, fits, strict=True)))


def fold_losses(fit: MultiStepFit, p: MultiStep, fold: int, scale: np.ndarray) -> np.ndarray:
    """Return the mean loss of a fit in each cell (time interval of `WINDOW_S`) of a held-out fold.

    ``fit`` did not use the windows of this fold; ``p`` contains the windows of all folds. ``scale``
    as in `cell_losses`.
    """
    test = with_windows(p, [split_windows(f, fold)[1] for f in p.flights]).flights
    each = replace(fit.problem, flights=test).errors(fit.z, fit.noise, STAGE_S)
    return np.concatenate([cell_losses(f, e, scale) for f, e in zip(test, each, strict=True)])


def recording_losses(fit: MultiStepFit, p: MultiStep, i: int, scale: np.ndarray) -> np.ndarray:
    """Return the mean loss of a fit in each cell (time interval of `WINDOW_S`) of recording i.

    ``fit`` did not use recording i; ``p`` contains all recordings. ``scale`` as in `cell_losses`.
    """
    q, flight = fit.problem, p.flights[i]
    rows = p.data[i].recorded_rows
    data = split_at_climb_end(p.data[i], int(np.argmax(rows == flight.starts[0])))
    states = filter_jittered(q.structure, fit.values, data, fit.noise, q.varying).states
    X = np.full((len(flight.t), states.shape[1]), np.nan)
    X[rows[rows >= 0]] = states[rows >= 0]
    ahead = np.array([max(1, round(h / flight.dt)) for h in STAGE_S])
    e = errors(q.structure, fit.values, flight, X, ahead, tuple(q.varying))
    e = np.clip(np.nan_to_num(e, nan=FAR, posinf=FAR, neginf=-FAR), -FAR, FAR)
    e[..., ~flight.free] = 0.0
    return cell_losses(flight, e, scale)


def cell_losses(flight: Flight, e: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Return the mean robust loss (m,) of the predictions that start in each cell of a flight.

    The m cells are time intervals of `WINDOW_S`. ``e`` (S, M, 3): errors in rad of S predictions at
    M horizons. ``scale`` (M, 3): RMS errors in rad, by which ``e`` is divided.
    """
    loss = (robust(e / scale) ** 2).mean(axis=1).sum(axis=1)
    cell = np.floor(flight.t[flight.starts] / WINDOW_S).astype(int)
    return np.array([loss[cell == c].mean() for c in np.unique(cell)])


def split_at_climb_end(data: Data, row: int) -> Data:
    """Return the data; the block (interval of usable rows) that contains ``row`` is split there.

    ``row`` is the end of the climb after take-off. The filter restarts there, so that the climb
    does not bias its estimates.
    """
    blocks = []
    for lead, start, stop in data.blocks.tolist():
        cut = row if start + 2 < row < stop - 2 else stop
        blocks += [(lead, a, b) for a, b in ((start, cut), (cut, stop)) if b > a]
    return with_blocks(data, np.array(blocks))


def bootstrap(increase: np.ndarray, seed: int) -> LossIncrease:
    """Return the mean of ``increase`` with its bootstrap interval.

    ``increase`` (m,): increase of the held-out loss in each of m cells (time intervals of
    `WINDOW_S`).
    """
    rng = np.random.default_rng([seed, 7])
    means = increase[rng.integers(0, len(increase), (DRAWS, len(increase)))].mean(axis=1)
    positive = float((means > 0).mean())
    return LossIncrease(float(increase.mean()), *interval(means), float(means.std()), positive)
