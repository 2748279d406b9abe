"""A fit evaluated on rows that it has not seen.

On hold-out recordings as it stands; without them on blocks of the flight itself, each left out in
turn with `PURGE_S` on either side, the fit made again from the rest:

    θ_{−b} starts at θ̂ + (H − H_b + Λ)⁻¹ (g − g_b − Λ(θ̂ − θ_0)),   then Gauss and Newton as ever

H, g the sums over events and H_b, g_b those of the block (one step is nearly the whole way). The
filter runs through the whole flight with θ_{−b}; only what it says in the block counts.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.diagnosis.ahead import ahead, of_rows
from heli3dof.diagnosis.gain import CELL_S, HORIZON_S, Course, HeldOut
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.fit import maximise
from heli3dof.identification.greybox.likelihood import Likelihood, score_and_information
from heli3dof.identification.greybox.method import usable_runs
from heli3dof.model.filtering import LEAD_S, Data, data_of
from heli3dof.recording.recording import Recording

BLOCKS = 5
LEAST_BLOCK_S = 3.0
PURGE_S = 0.5
ROUNDS = 3
LEAST_PIECE_S = 1.0
THREADS = 2


def on_holdout(found: Estimate, recordings: Sequence[Recording]) -> HeldOut:
    """A fit as it stands, on recordings that it was not made from."""
    runs = [run for i, r in enumerate(recordings) for run in usable_runs(r, i)]
    problem = Likelihood(data_of(recordings, runs), found.structure)
    o = found.optimum
    inside = np.ones(len(problem.data.t), dtype=bool)
    return _cells(problem.data, "holdout", [_evaluate(problem, o.theta, o.noise, inside)])


def on_blocks(found: Estimate, blocks: int = BLOCKS) -> HeldOut:
    """The fit made again without each block, on that block."""
    d = found.problem.data

    def one(rows: tuple[int, int]) -> Seen:
        theta, noise = _refitted(found, rows)
        inside = np.zeros(len(d.t), dtype=bool)
        inside[rows[0] : rows[1]] = True
        return _evaluate(found.problem, theta, noise, inside)

    with ThreadPoolExecutor(THREADS) as pool:
        return _cells(d, "blocks left out", list(pool.map(one, _cuts(d, blocks))))


def held_out(found: Estimate, holdout: Sequence[Recording]) -> HeldOut:
    """On the hold-out recordings where there are any, else on blocks left out."""
    return on_holdout(found, holdout) if holdout else on_blocks(found)


def _cuts(d: Data, blocks: int) -> list[tuple[int, int]]:
    """Rows [a, b) of each block: equal shares of the rows that count, end to end."""
    rows = np.concatenate([np.arange(start, stop) for _, start, stop in d.blocks])
    dt = float(np.median(d.h))
    n = int(np.clip(len(rows) * dt / LEAST_BLOCK_S, 2, blocks))
    ends = np.linspace(0, len(rows), n + 1).astype(int)
    return [(int(rows[a]), int(rows[b - 1]) + 1) for a, b in itertools.pairwise(ends)]


def training(d: Data, rows: tuple[int, int]) -> Data:
    """The data without rows [a, b) and `PURGE_S` on either side."""
    dt = float(np.median(d.h))
    purge, least, lead = (round(s / dt) for s in (PURGE_S, LEAST_PIECE_S, LEAD_S))
    a, b = rows[0] - purge, rows[1] + purge
    kept = []
    for first, start, stop in d.blocks.tolist():
        for low, high in ((start, min(stop, a)), (max(start, b), stop)):
            if high - low >= least:
                kept.append((max(first, low - lead), low, high))
    return of_rows(d, np.array(kept, dtype=np.int64).reshape(-1, 3))


def _refitted(found: Estimate, rows: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """(θ, noise) without these rows; the prior's where nothing else is left."""
    problem = replace(found.problem, data=training(found.problem.data, rows))
    o = found.optimum
    if not len(problem.data.blocks):
        return problem.prior_mean, o.noise
    counted = np.zeros(len(problem.data.t), dtype=bool)
    for _, start, stop in problem.data.blocks:
        counted[start:stop] = True
    of = counted[o.at.row]
    some = replace(o.at, g=np.where(of, o.at.g, 0.0), w=np.where(of, o.at.w, 0.0))
    g, H = score_and_information(some, o.tangents)
    precision = problem.prior_precision
    g = g - precision * (o.theta - problem.prior_mean)
    start = o.theta + np.linalg.solve(H + np.diag(precision), g)
    best = maximise(problem, np.clip(start, *problem.bounds), o.noise, rounds=ROUNDS)
    return best.theta, best.noise


@dataclass(frozen=True, eq=False)
class Seen:
    """What a fit says of some rows: nothing of the others."""

    loglik: np.ndarray
    """(N,) ln Z of each row; 0 outside"""
    ends: np.ndarray
    """(S,) the rows in which predictions end"""
    errors: np.ndarray
    """(S, 3) rad; NaN where not wholly inside"""


def _evaluate(
    problem: Likelihood, theta: np.ndarray, noise: np.ndarray, inside: np.ndarray
) -> Seen:
    d = problem.data
    X = problem.run(theta, noise, keep=3).X
    assert X is not None
    loglik = np.zeros(len(d.t))
    total = 0.0
    for _, start, stop in d.blocks:
        so_far = X[start:stop, 6:].sum(axis=1)
        loglik[start:stop] = np.diff(so_far, prepend=total)
        total = float(so_far[-1])
    loglik[~inside] = 0.0
    e = ahead(problem, theta, X, (HORIZON_S,))
    n = round(HORIZON_S / float(np.median(d.h)))
    ends = np.minimum(e.starts + n, len(d.t) - 1)
    whole = inside[e.starts] & inside[ends]
    return Seen(loglik, ends, np.where(whole[:, None], e.errors[:, 0], np.nan))


def _cells(d: Data, on: str, parts: Sequence[Seen]) -> HeldOut:
    """Rows gathered into cells of about `CELL_S` that do not cross runs."""
    which = np.full(len(d.t), -1, dtype=np.int64)
    starts: list[float] = []
    source: list[int] = []
    for run, (_, start, stop) in zip(d.runs, d.blocks, strict=True):
        dt = float(np.median(d.h[start:stop]))
        n = max(1, round((stop - start) * dt / CELL_S))
        which[start:stop] = len(starts) + (np.arange(stop - start) * n) // (stop - start)
        first = start + np.ceil(np.arange(n) * (stop - start) / n).astype(int)
        starts += d.t[first].tolist()
        source += [run.source] * n
    m = len(starts)
    loglik = np.sum([p.loglik for p in parts], axis=0)
    ends = parts[0].ends
    errors = parts[0].errors
    for p in parts[1:]:
        errors = np.where(np.isfinite(errors), errors, p.errors)
    squares, counts = np.zeros((m, 3)), np.zeros((m, 3))
    for i in range(3):
        there = np.isfinite(errors[:, i])
        cell = which[ends[there]]
        squares[:, i] = np.bincount(cell, errors[there, i] ** 2, m)
        counts[:, i] = np.bincount(cell, minlength=m)
    flown = which >= 0
    sources = np.array(source, dtype=np.int64)
    return HeldOut(
        np.bincount(which[flown], loglik[flown], m),
        squares,
        counts,
        np.array(starts),
        sources,
        on,
        Course(d.t[ends], sources[which[ends]], d.y[ends], d.y[ends] - errors),
    )
