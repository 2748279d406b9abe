"""Evaluate a fit on held-out data.

If there are hold-out recordings, the fit is evaluated on them. Otherwise the evaluation is a
cross-validation. It leaves out each block b of the training recordings once, with `PURGE_S` of rows
on either side. A Gauss-Newton step from the fit θ̂ gives the parameters θ_{−b} that the remaining
rows determine:

    θ_{−b} = θ̂ + (H − H_b + Λ)⁻¹ (g − g_b − (1 − s) ḡ − Λ(θ̂ − θ_0))

    g, H, g_b, H_b   score and information at θ̂: of all rows, and of those left out
    s                share of the filter's measurement updates that are left out
    ḡ                bias of the score (`bias_correction.correction`), or zero
    θ_0, Λ           mean and precision of the prior

A few quantities are estimated with the held-out data all the same: see items 3 to 5.

1. If the step is longer than `LONG_STEP`, up to `SEARCH_ROUNDS` further steps follow.
2. If simulated flights give the score's covariance C, Λ_jj ← Λ_jj max(1, C_jj/H_jj), with C and H
   of the remaining rows. Without this change of Λ, an inertia could diverge if the left-out block
   contains the only step.
3. In cross-validation, the instant of a mass change (`bias_correction.evaluation.SCANNED`) keeps
   its value in θ̂: the remaining rows contain no information on it.
4. The process noise is re-estimated on the evaluated rows, for the model with added effects and
   for the model without them. So a flight with more noise favours neither model.
5. Each recording has its own phase of a periodic torque, and its own instant of a mass change
   (`effects.Parameter.per_recording`). For a hold-out recording, they are estimated on that
   recording (`validation.prediction`). In a fit to several recordings, the time of each recording
   is shifted so that the torque has one common phase. Cross-validation does not estimate these
   shifts again: it uses those estimated from all rows, including the left-out block.
6. The filter starts `SETTLE_S` before the evaluated rows. With backlash it starts
   `BACKLASH_SETTLE_S` before them, because only encoder edges in both directions determine the
   position within the backlash.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from heli3dof.diagnosis.validation.gain import (
    CELL_S,
    HORIZON_S,
    HeldOut,
    Predictions,
    sums_by_cell,
)
from heli3dof.diagnosis.validation.prediction import (
    measured_rows,
    prediction_errors,
    problem_of,
    rows_ahead,
    rows_of_recordings,
    starts_of,
    with_blocks,
    with_own_values,
)
from heli3dof.identification.bias_correction.corrected_maximum import ScoreBias, maximise_corrected
from heli3dof.identification.bias_correction.evaluation import fixed_parameters
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.likelihood import Likelihood, score_and_information
from heli3dof.identification.greybox.maximum_likelihood import NOISE_SETTLED
from heli3dof.model.estimation.ekf_quantised import FilterRun
from heli3dof.model.estimation.filter_data import LEAD_S, Data
from heli3dof.parallel import parallel_map
from heli3dof.recording.recording import Recording

BLOCKS = 5
"""Largest number of blocks. Chosen."""
MIN_BLOCK_S = 3.0
"""s; least length of a block. There are always at least two blocks, even if shorter. Chosen."""
PURGE_S = 0.5
"""s; rows on either side of a block that are left out with it. Chosen."""
SEARCH_ROUNDS = 4
"""Largest number of Gauss-Newton iterations after a long step. Chosen."""
LONG_STEP = 1.0
"""Standard deviations: if the first step is longer, the search continues. Chosen."""
MIN_INTERVAL_S = 1.0
"""s; shorter intervals of training rows next to a left-out block are not used. Chosen."""
SETTLE_S, BACKLASH_SETTLE_S = 1.0, 5.0
"""s; time the filter runs before the evaluated rows, without and with backlash. Chosen."""
NOISE_STEPS = 4
"""Largest number of Newton steps for the noise intensities. Chosen."""
_LOG_STEP = 0.4  # step of the log intensity, for finite differences


def on_holdout(
    fit: Estimate, recordings: Sequence[Recording], theta: np.ndarray | None = None
) -> HeldOut:
    """Evaluate a fit on recordings that it did not use.

    If ``theta`` (n,) is given, the model with these parameters is evaluated instead of the fit.
    """
    problem, optimum = problem_of(fit.structure, recordings), fit.optimum
    theta = optimum.theta if theta is None else theta

    results = []
    for rows in rows_of_recordings(problem.data):
        own = with_own_values(problem, theta, optimum.noise, rows)
        results.append(_evaluate(problem, own, optimum.noise, rows))
    return _summed_over_cells(problem.data, "holdout", results)


def on_blocks(fit: Estimate, theta: np.ndarray | None = None) -> HeldOut:
    """Evaluate a fit on each block of its recordings, with parameters from the other blocks.

    ``theta`` (n,), if given, replaces these parameters in all blocks.
    """
    problem, o, d = fit.problem, fit.optimum, fit.problem.data
    at = problem.run(o.theta, o.noise)
    tangents = problem.tangents(o.theta, at)
    cuts = _blocks(d)

    def evaluate_block(k: int) -> tuple[np.ndarray, np.ndarray]:
        own = _estimate_without(fit, at, tangents, cuts[k]) if theta is None else theta
        return _evaluate(problem, own, o.noise, cuts[k])

    return _summed_over_cells(
        d, "blocks left out", parallel_map(evaluate_block, len(cuts), what="blocks")
    )


def held_out(
    fit: Estimate, holdout: Sequence[Recording], theta: np.ndarray | None = None
) -> HeldOut:
    """Evaluate a fit on the hold-out recordings if there are any, else by cross-validation.

    If ``theta`` (n,) is given, the model with these parameters is evaluated instead of the fit, on
    the same rows. Cross-validation then refits no parameter.
    """
    return on_holdout(fit, holdout, theta) if holdout else on_blocks(fit, theta)


def _blocks(d: Data) -> list[tuple[int, int]]:
    """Return the rows [a, b) of each block; all blocks have equally many measured rows."""
    rows = measured_rows(d)
    dt = float(np.median(d.h))
    n = int(np.clip(len(rows) * dt / MIN_BLOCK_S, 2, BLOCKS))
    ends = np.linspace(0, len(rows), n + 1).astype(int)
    return [(int(rows[a]), int(rows[b - 1]) + 1) for a, b in itertools.pairwise(ends)]


def training(d: Data, rows: tuple[int, int]) -> Data:
    """Return the data without the rows [a, b) and without `PURGE_S` on either side."""
    purge = round(PURGE_S / float(np.median(d.h)))
    ranges = (0, rows[0] - purge), (rows[1] + purge, len(d.t))
    return _restricted(d, ranges, least_s=MIN_INTERVAL_S)


def _restricted(
    d: Data, ranges: Sequence[tuple[int, int]], *, least_s: float = 0.0, settle_s: float = 0.0
) -> Data:
    """Return the data of the rows in ``ranges`` [a, b), with up to ``settle_s`` before them.

    A range may contain only part of a run (interval of usable rows). Parts that are shorter than
    ``least_s`` are left out.
    """
    dt = float(np.median(d.h))
    least, settle, lead = (round(s / dt) for s in (least_s, settle_s, LEAD_S))
    kept = []
    for first, start, stop in d.blocks.tolist():
        for a, b in ranges:
            low, high = max(start, a - settle), min(stop, b)
            if high - max(low, a) >= max(least, 1):
                kept.append((max(first, low - lead), low, high))
    return with_blocks(d, np.array(kept, dtype=np.int64).reshape(-1, 3))


def _estimate_without(
    fit: Estimate, at: FilterRun, tangents: np.ndarray, rows: tuple[int, int]
) -> np.ndarray:
    """Return parameters (n,) estimated without ``rows`` [a, b); prior mean if no row remains."""
    problem = replace(fit.problem, data=training(fit.problem.data, rows))
    theta, noise = fit.optimum.theta, fit.optimum.noise
    if not len(problem.data.blocks):
        return problem.prior_mean
    remains = np.isin(at.row, measured_rows(problem.data))
    bias_of_rows = fit.score_bias * float(remains.mean())
    g, H = score_and_information(
        replace(at, g=np.where(remains, at.g, 0.0), w=np.where(remains, at.w, 0.0)), tangents
    )
    precision = problem.prior_precision
    C = getattr(fit, "score_covariance", None)
    if C is not None:
        share = np.diag(C) * float(remains.mean())
        precision = precision * np.maximum(1.0, share / np.maximum(np.diag(H), 1e-12))
        vars(problem)["prior_precision"] = precision  # replaces that of the `cached_property`
    A = H + np.diag(precision)
    step, free = np.zeros(len(theta)), ~fixed_parameters(problem)
    gradient = g - bias_of_rows - precision * (theta - problem.prior_mean)
    step[free] = np.linalg.solve(A[np.ix_(free, free)], gradient[free])
    updated = np.clip(theta + step, *problem.bounds)
    if float(step @ A @ step) < LONG_STEP**2:
        return np.asarray(updated)
    correction = ScoreBias(bias_of_rows, np.zeros(3), theta, noise)
    return maximise_corrected(
        problem, updated, noise, correction, rounds=SEARCH_ROUNDS, hold_noise=True
    ).theta


def _evaluate(
    problem: Likelihood, theta: np.ndarray, noise: np.ndarray, rows: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """Return log-likelihood and prediction errors of the model at θ (n,) on ``rows`` [a, b).

    The process noise is estimated on ``rows``; the search for it starts at ``noise`` (4,). The
    log-likelihood ln Z (N,) of each data row is 0 outside ``rows``. The errors (S, 3) rad are those
    of predictions over `HORIZON_S` from the S rows `starts_of`. An error is NaN unless its
    prediction starts and ends in ``rows``.
    """
    data = problem.data
    evaluated = replace(problem, data=_restricted(data, [rows], settle_s=settling_s(problem)))
    noise = _most_likely_noise(evaluated, theta, noise, rows[0])
    X = evaluated.run(theta, noise, keep=3).X
    assert X is not None
    loglik = row_by_row(evaluated.data, X).sum(axis=1)
    loglik[: rows[0]] = 0.0
    starts = starts_of(data)
    errors = prediction_errors(evaluated, theta, X, (HORIZON_S,), starts)[:, 0]
    errors[(starts < rows[0]) | (_ends(data) >= rows[1])] = np.nan
    return loglik, errors


def _ends(d: Data) -> np.ndarray:
    """Return the index of the row in which each of the S predictions ends: an array (S,).

    Predictions start from the rows `starts_of` and last `HORIZON_S`. For a prediction that would
    end beyond the data, the index is that of the last row.
    """
    return np.asarray(np.minimum(starts_of(d) + rows_ahead(d, (HORIZON_S,)), len(d.t) - 1))


def settling_s(problem: Likelihood) -> float:
    """Return the filter's settling time in s, from its start to the first evaluated row."""
    has_backlash = any(t.effect.starts for t in problem.structure.terms)
    return BACKLASH_SETTLE_S if has_backlash else SETTLE_S


def row_by_row(d: Data, X: np.ndarray) -> np.ndarray:
    """Return each row's log-likelihood ln Z (N, 3) by axis; 0 in rows that the filter omits.

    ``X`` (N, 9) is the result of the filter: columns 0 to 5 are states, columns 6 to 8 the sums of
    ln Z over all rows up to each row, by axis.
    """
    out, rows = np.zeros((len(d.t), 3)), measured_rows(d)
    out[rows] = np.diff(X[rows, 6:], axis=0, prepend=np.zeros((1, 3)))
    return out


def _most_likely_noise(
    problem: Likelihood, theta: np.ndarray, noise: np.ndarray, first: int
) -> np.ndarray:
    """Return the noise (4,) with which the likelihood of the rows from ``first`` on is largest.

    Elements 0 to 2 are the process noise on the three axes. Element 3, the sampling jitter, stays
    that of ``noise``, at which the search starts. The likelihood omits the rows before ``first``,
    because the filter has not settled there: its estimates of the angular rates may be far wrong.
    """
    a = np.array(noise, dtype=float)
    best, highest = a.copy(), np.full(3, -np.inf)
    axes = problem.data.axes

    def loglik(at: np.ndarray) -> np.ndarray:
        X = problem.run(theta, at, keep=3).X
        assert X is not None
        out = np.asarray(row_by_row(problem.data, X)[first:].sum(axis=0))
        best[:3] = np.where(out > highest, at[:3], best[:3])
        highest[:] = np.maximum(out, highest)
        return out

    for _ in range(NOISE_STEPS):
        up, mid, down = (
            loglik(np.append(a[:3] * np.exp(d), a[3])) for d in (_LOG_STEP, 0.0, -_LOG_STEP)
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            slope, curvature = (up - down) / (2 * _LOG_STEP), (2 * mid - up - down) / _LOG_STEP**2
            move = np.where(curvature > 0, slope / curvature, np.sign(slope))
        move = np.where(axes & np.isfinite(move), np.clip(move, -1.0, 1.0), 0.0)
        a[:3] *= np.exp(move)
        if np.abs(move).max() < NOISE_SETTLED:
            break
    loglik(a)
    return best


def _summed_over_cells(d: Data, on: str, parts: Sequence[tuple[np.ndarray, np.ndarray]]) -> HeldOut:
    """Sum log-likelihoods and squared prediction errors within each cell of the data.

    A cell is a time interval of about `CELL_S` seconds; the result has one sum for each cell. Each
    of ``parts`` is the result of `_evaluate` on one hold-out recording or block: log-likelihood and
    prediction errors. ``on``: description of the held-out data.
    """
    cell_of_row, recorded_t = np.zeros(len(d.t), dtype=np.int64), d.recorded_t
    starts: list[float] = []
    source: list[int] = []
    for run, (lead, start, stop) in zip(d.runs, d.blocks, strict=True):
        dt = float(np.median(d.h[start:stop]))
        n = max(1, round((stop - start) * dt / CELL_S))
        cell_of_row[lead:start] = len(starts)
        cell_of_row[start:stop] = len(starts) + (np.arange(stop - start) * n) // (stop - start)
        first = start + np.ceil(np.arange(n) * (stop - start) / n).astype(int)
        starts += recorded_t[first].tolist()
        source += [run.source] * n
    loglik = np.sum([loglik for loglik, _ in parts], axis=0)
    errors = np.fmax.reduce([errors for _, errors in parts])  # the only finite one of each start
    ends, sources = _ends(d), np.array(source, dtype=np.int64)
    cell, m = cell_of_row[ends], len(starts)
    return HeldOut(
        np.bincount(cell_of_row, loglik, m),
        *sums_by_cell(errors, cell, m),
        np.array(starts),
        sources,
        on,
        Predictions(recorded_t[ends], sources[cell], d.y[ends], d.y[ends] - errors),
    )
