"""A fit evaluated on rows that it has not seen.

On hold-out recordings as it stands; without them on blocks of the flight itself, each left out in
turn with `PURGE_S` on either side, the fit made again from the rest:

    θ_{−b} = θ̂ + (H − H_b + Λ)⁻¹ (g − g_b − (1 − s) ḡ − Λ(θ̂ − θ_0))

H, g the sums over events, H_b, g_b those of the block, s its share of them and ḡ the filter's bias
where the fit was freed of it (`estimate.bias_correction`). Where that step is longer than `FAR`
standard deviations it is only the start, and Gauss and Newton go on from there.

Holds alone say little of an inertia, yet their score of it scatters (encoders chatter) by far more
than that little: without a flight's only step an inertia would run off to a multiple. Where flights
of the fit tell how its score scatters, C, the prior counts the more, the less the score is worth,

    Λ_jj ← Λ_jj max(1, C_jj / H_jj),     C and H of what is left

An instant stays where a scan put it (`estimate.evaluation.HELD`): no other block tells
when within this one a mass changed, and a step along it would leave a rig whose mass never did.

The noise is no part of a cause: its intensities are found again on the data that judge, for the
base as for the extension, so that neither wins because a later flight was a rougher one.

The filter that judges starts a while before a block. Beside a play that while is `PLAY_SETTLE_S`:
where within the play the axis stands only edges of both flanks tell, and a filter that does not
know it takes the next edges for ones that were hardly possible: a block's first two seconds alone
may cost more of ln Z than the cause that is judged wins in the whole flight.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.diagnosis.estimate.corrected_maximum import ScoreBias, maximise_corrected
from heli3dof.diagnosis.estimate.evaluation import held
from heli3dof.diagnosis.validation.gain import CELL_S, HORIZON_S, Course, HeldOut
from heli3dof.diagnosis.validation.prediction import ahead, of_rows, starts_of
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.likelihood import Likelihood, Pass, score_and_information
from heli3dof.identification.greybox.maximum_likelihood import NOISE_SETTLED
from heli3dof.identification.greybox.method import usable_runs
from heli3dof.model.estimation.filter_data import LEAD_S, Data, data_of
from heli3dof.parallel import parallel_map
from heli3dof.recording.recording import Recording

BLOCKS = 5
LEAST_BLOCK_S = 3.0
PURGE_S = 0.5
ROUNDS = 4
FAR = 1.0
LEAST_PIECE_S = 1.0
SETTLE_S, PLAY_SETTLE_S = 1.0, 5.0
"""The filter starts this much before the rows that count; so much where it knows of a play."""
NOISE_STEPS = 4
_PROBE = 0.4  # step of the log intensity


def on_holdout(
    found: Estimate, recordings: Sequence[Recording], theta: np.ndarray | None = None
) -> HeldOut:
    """A fit as it stands, or with other coordinates θ (n,), on recordings it was not made from."""
    runs = [run for i, r in enumerate(recordings) for run in usable_runs(r, i)]
    problem = Likelihood(data_of(recordings, runs), found.structure)
    o = found.optimum
    at = o.theta if theta is None else theta
    seen = _evaluate(problem, at, o.noise, (0, len(problem.data.t)))
    return _cells(problem.data, "holdout", [seen])


def on_blocks(found: Estimate, blocks: int = BLOCKS) -> HeldOut:
    """The fit made again without each block, on that block."""
    problem, o, d = found.problem, found.optimum, found.problem.data
    at = problem.run(o.theta, o.noise)
    tangents = problem.tangents(o.theta, at)

    cuts = _cuts(d, blocks)

    def one(k: int) -> Seen:
        theta = _refitted(found, at, tangents, cuts[k])
        return _evaluate(problem, theta, o.noise, cuts[k])

    return _cells(d, "blocks left out", parallel_map(one, len(cuts), what="blocks"))


def uncalibrated(found: Estimate, holdout: Sequence[Recording]) -> HeldOut:
    """Evaluate the structure of ``found`` with the profile's numbers, on the rows of `held_out`."""
    problem, noise = found.problem, found.optimum.noise
    theta = problem.coordinates(found.structure.values_of({}))
    if holdout:
        return on_holdout(found, holdout, theta)
    cuts = _cuts(problem.data, BLOCKS)
    seen = parallel_map(lambda k: _evaluate(problem, theta, noise, cuts[k]), len(cuts))
    return _cells(problem.data, "blocks left out", seen)


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


def _refitted(found: Estimate, at: Pass, tangents: np.ndarray, rows: tuple[int, int]) -> np.ndarray:
    """θ without these rows; the prior's where nothing else is left."""
    problem = replace(found.problem, data=training(found.problem.data, rows))
    theta, noise = found.optimum.theta, found.optimum.noise
    if not len(problem.data.blocks):
        return problem.prior_mean
    counted = np.zeros(len(problem.data.t), dtype=bool)
    for _, start, stop in problem.data.blocks:
        counted[start:stop] = True
    of = counted[at.row]
    bias = getattr(found, "bias", None)
    tilt = np.zeros(len(theta)) if bias is None else bias * float(of.mean())
    g, H = score_and_information(
        replace(at, g=np.where(of, at.g, 0.0), w=np.where(of, at.w, 0.0)), tangents
    )
    precision = problem.prior_precision
    scatter = getattr(found, "scatter", None)
    if scatter is not None:
        share = np.diag(scatter) * float(of.mean())
        precision = precision * np.maximum(1.0, share / np.maximum(np.diag(H), 1e-12))
        problem = _believing(problem, precision)
    A = H + np.diag(precision)
    step, go = np.zeros(len(theta)), ~held(problem)
    slope = g - tilt - precision * (theta - problem.prior_mean)
    step[go] = np.linalg.solve(A[np.ix_(go, go)], slope[go])
    there = np.clip(theta + step, *problem.bounds)
    if float(step @ A @ step) < FAR**2:
        return np.asarray(there)
    false = ScoreBias(tilt, np.zeros(3), theta, noise)
    return maximise_corrected(problem, there, noise, false, rounds=ROUNDS, hold_noise=True).theta


def _believing(problem: Likelihood, precision: np.ndarray) -> Likelihood:
    """The same likelihood beside a prior of that precision (n,)."""
    new = replace(problem)
    vars(new)["prior_precision"] = precision  # where its `cached_property` would keep it
    return new


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
    problem: Likelihood, theta: np.ndarray, noise: np.ndarray, rows: tuple[int, int]
) -> Seen:
    """What the rig at θ says of rows [a, b), at the noise that suits it best there."""
    whole = problem.data
    near = replace(problem, data=_near(whole, rows, settling_s(problem)))
    noise = _noise(near, theta, noise, rows[0])
    X = near.run(theta, noise, keep=3).X
    assert X is not None
    loglik = row_by_row(near.data, X).sum(axis=1)
    inside = np.zeros(len(whole.t), dtype=bool)
    inside[rows[0] : rows[1]] = True
    loglik[~inside] = 0.0
    # Starts are those of the whole data, so that all blocks share them.
    e = ahead(near, theta, X, (HORIZON_S,), starts_of(whole))
    n = round(HORIZON_S / float(np.median(whole.h)))
    ends = np.minimum(e.starts + n, len(whole.t) - 1)
    counts = inside[e.starts] & inside[ends]
    return Seen(loglik, ends, np.where(counts[:, None], e.errors[:, 0], np.nan))


def settling_s(problem: Likelihood) -> float:
    """How long before the rows that count the filter starts."""
    played = any(t.effect.starts for t in problem.structure.terms)
    return PLAY_SETTLE_S if played else SETTLE_S


def _near(d: Data, rows: tuple[int, int], settle_s: float = SETTLE_S) -> Data:
    """The runs' parts in rows [a, b), each with ``settle_s`` before it where there is as much."""
    dt = float(np.median(d.h))
    settle, lead = round(settle_s / dt), round(LEAD_S / dt)
    kept = []
    for first, start, stop in d.blocks.tolist():
        low, high = max(start, rows[0] - settle), min(stop, rows[1])
        if high > max(low, rows[0]):
            kept.append((max(first, low - lead), low, high))
    return of_rows(d, np.array(kept, dtype=np.int64).reshape(-1, 3))


def row_by_row(d: Data, X: np.ndarray) -> np.ndarray:
    """(N, 3) ln Z of each row by axis, from a pass with ``keep`` 3; 0 outside the blocks."""
    out = np.zeros((len(d.t), 3))
    total = np.zeros(3)
    for _, start, stop in d.blocks:
        out[start:stop] = np.diff(X[start:stop, 6:], axis=0, prepend=total[None])
        total = X[stop - 1, 6:]
    return out


def _noise(problem: Likelihood, theta: np.ndarray, noise: np.ndarray, first: int) -> np.ndarray:
    """(4,) with the intensities at which the rows from ``first`` are likeliest; Newton, by axis,
    and of all that were tried the likeliest: too little noise costs hundreds at a single edge.

    The rows before it only settle the filter. A filter that starts on an encoder's edge takes its
    chatter for a rate, and noise that was fitted to that would spoil everything after.
    """
    a = np.array(noise, dtype=float)
    best, most = a.copy(), np.full(3, -np.inf)
    axes = problem.data.axes

    def loglik(at: np.ndarray) -> np.ndarray:
        X = problem.run(theta, at, keep=3).X
        assert X is not None
        out = np.asarray(row_by_row(problem.data, X)[first:].sum(axis=0))
        best[:3] = np.where(out > most, at[:3], best[:3])
        most[:] = np.maximum(out, most)
        return out

    for _ in range(NOISE_STEPS):
        up, mid, down = (loglik(np.append(a[:3] * np.exp(d), a[3])) for d in (_PROBE, 0.0, -_PROBE))
        with np.errstate(divide="ignore", invalid="ignore"):
            slope, bend = (up - down) / (2 * _PROBE), (2 * mid - up - down) / _PROBE**2
            move = np.where(bend > 0, slope / bend, np.sign(slope))
        move = np.where(axes & np.isfinite(move), np.clip(move, -1.0, 1.0), 0.0)
        a[:3] *= np.exp(move)
        if np.abs(move).max() < NOISE_SETTLED:
            break
    loglik(a)
    return best


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
