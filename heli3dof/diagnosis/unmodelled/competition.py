"""Test whether one free-form torque explains the flight better than several named causes together.

Causes of the catalogue may together imitate a torque outside it. On pitch, k V_f V_b is, to first
order about hover, a thrust mismatch and a constant torque. With both in the fit, no residual torque
is significant (`unmodelled.unmodelled_torque`). So each subset s of the causes competes with each
free-form torque. Let d_s (p,) be the distance of s from absence in the fit's coordinates. With A,
X, g, u of `unmodelled.torque_evidence`, the linearised scores in the absence of s are

    g° = g + A d_s,      u° = u + Xᵀ d_s

The remaining coordinates r are projected out of both and of their information matrices:

    U = u° − X_rᵀ A_rr⁻¹ g°_r with information V;      G of g°_s with information W, likewise

Rao's score statistics are twice the gains in log-likelihood:

    named = Gᵀ W⁻¹ G,      free = Uᵀ V⁺ U,      both: of G and U jointly

The free-form torque replaces the causes if all of these hold:

1. free − named > (rank V − n_s) ln N: BIC, with n_s parameters of the causes and N readings.
2. free − named > mean + `NULL_SIGMAS` σ of this difference in null simulations of the fit.
3. both − free < max(`MAX_REMAINING` named, n_s ln N). A true cause violates this if it acts on
   several axes, or has a shape that a function of one variable fits only with more parameters.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.sensitivity.hat_functions import forward
from heli3dof.diagnosis.unmodelled.torque_evidence import Evidence, Nuisance, informative_directions
from heli3dof.diagnosis.unmodelled.unmodelled_torque import ResidualTorque, minus_2_log_p, share_of
from heli3dof.identification.greybox.estimate import Estimate

NULL_SIGMAS = 6.0
"""Standard deviations of the nulls' free − named. Chosen; not derived."""
MAX_REMAINING = 0.25
"""Largest share of ``named`` that the causes may still gain with the free form fitted. Chosen."""


@dataclass(frozen=True)
class Contest:
    """Gains of a free-form torque and of the causes ``names`` that it would replace."""

    names: tuple[str, ...]
    axis: str
    depends_on: str
    free: float
    named: float
    both: float
    rank: int
    parameters: int
    events: int
    """n_s and N"""
    nulls: tuple[float, float]
    """Mean and standard deviation of free − named in the nulls"""

    @property
    def bic_margin(self) -> float:
        """Return free − named − (rank − n_s) ln N."""
        return self.free - self.named - (self.rank - self.parameters) * float(np.log(self.events))

    @property
    def wins(self) -> bool:
        """Return True if the free-form torque replaces the causes."""
        mean, std = self.nulls
        price = self.parameters * float(np.log(self.events))
        exceeds_nulls = self.free - self.named > mean + NULL_SIGMAS * std
        return (
            self.bic_margin > 0
            and exceeds_nulls
            and self.both - self.free < max(MAX_REMAINING * self.named, price)
        )


def winning_torque(evidence: Evidence, names: Sequence[str]) -> Contest | None:
    """Return the winning contest with the largest ``bic_margin``; None without winner or nulls."""
    if evidence.null is None or not names:
        return None
    winners = (c for c in contests(evidence, names) if c.wins)
    return max(winners, key=lambda c: c.bic_margin, default=None)


def contests(evidence: Evidence, names: Sequence[str]) -> Iterator[Contest]:
    """Yield the contest of every subset of ``names`` with every free-form torque."""
    null, nuisance = evidence.null, evidence.nuisance
    assert null is not None
    B = len(null.u)
    mean_g, mean_u = nuisance.g_null.mean(axis=0), null.u.mean(axis=0)
    # From each null, the mean of the other nulls is subtracted.
    leave_one_out = B / (B - 1)
    g = np.vstack([nuisance.g - mean_g, (nuisance.g_null - mean_g) * leave_one_out])
    u = np.vstack([evidence.sums.u - mean_u, (null.u - mean_u) * leave_one_out])
    for count in range(1, len(names) + 1):
        for subset in itertools.combinations(names, count):
            replaced = np.array([f.term in subset for f in evidence.fit.free])
            d = distance_from_absence(evidence.fit) * replaced
            for q, (axis, variable) in enumerate(evidence.library.groups):
                c = evidence.library.columns(q)
                X, V = evidence.sums.cross[:, c], evidence.sums.V[q]
                free, named, both, rank = likelihood_gains(
                    nuisance.A, X, V, g, u[:, c], d, replaced
                )
                if rank:
                    null_margin = (free - named)[1:]
                    yield Contest(
                        subset, AXES[axis], variable, float(free[0]), float(named[0]),
                        float(both[0]), rank, int(replaced.sum()),
                        max(len(evidence.flight.at.row), 2),
                        (float(null_margin.mean()), float(null_margin.std(ddof=1))),
                    )  # fmt: skip


def distance_from_absence(fit: Estimate) -> np.ndarray:
    """Return the distance (p,) of each term's first coordinate from absence, along its tangent."""
    d, visited = np.zeros(len(fit.free)), set[str]()
    for j, (f, v) in enumerate(zip(fit.free, fit.values, strict=True)):
        if f.term is not None and f.term not in visited:
            visited.add(f.term)
            d[j] = (float(v) - f.null) / f.slope(float(v))
    return d


def as_residual_torque(evidence: Evidence, contest: Contest) -> ResidualTorque:
    """Return the winning free-form torque, estimated with the causes absent.

    ``share`` refers to the sum of this torque and the fit's residual torque. ``confidence`` is the
    probability of the torque against the causes at even prior odds: 1/(1 + exp(−bic_margin/2)).
    """
    null, nuisance, library = evidence.null, evidence.nuisance, evidence.library
    flight = evidence.flight
    assert null is not None
    axis = AXES.index(contest.axis)
    q = library.groups.index((axis, contest.depends_on))
    c = library.columns(q)
    replaced = np.array([f.term in contest.names for f in evidence.fit.free])
    d = distance_from_absence(evidence.fit) * replaced
    g = nuisance.g - nuisance.g_null.mean(axis=0) + nuisance.A @ d
    u = (evidence.sums.u - null.u.mean(axis=0))[c] + evidence.sums.cross[:, c].T @ d
    X = evidence.sums.cross[~replaced][:, c]
    solved = np.linalg.solve(nuisance.A[np.ix_(~replaced, ~replaced)], X)
    V = evidence.sums.V[q] - X.T @ solved
    E = informative_directions(V, evidence.sums.V[q])
    inverse = E @ np.linalg.inv(E.T @ V @ E) @ E.T
    torque = inverse @ (u - solved.T @ g[~replaced])
    m = library.variables.index(contest.depends_on)
    below, part = (a[:, m] for a in library.place(flight))
    rows = flight.flown & np.isfinite(flight.torque[:, axis])
    f = (torque[below] * (1 - part) + torque[below + 1] * part)[rows]
    residual = flight.torque[rows, axis]
    return ResidualTorque(
        contest.axis,
        contest.depends_on,
        share_of(residual + f - f.mean(), f - f.mean(), flight.data.h[rows]),
        tuple(
            (float(z), float(v)) for z, v in zip(library.knots[m], torque - f.mean(), strict=True)
        ),
        tuple(float(v) for v in np.sqrt(np.diag(inverse))),
        float(minus_2_log_p(np.array([contest.free - contest.named]), contest.rank)[0]),
        float(1 / (1 + np.exp(-min(contest.bic_margin, 200.0) / 2))),
        like=f"{contest.names[0]}-like",
    )


def nuisance_with_torque(evidence: Evidence, contest: Contest) -> Nuisance:
    """Return the nuisance parameters of the fit, extended by the free-form torque."""
    q = evidence.library.groups.index((AXES.index(contest.axis), contest.depends_on))
    c = evidence.library.columns(q)
    X, V = evidence.sums.cross[:, c], evidence.sums.V[q]
    P = informative_directions(V - X.T @ np.linalg.solve(evidence.nuisance.A, X), V)
    columns = np.arange(c.start, c.stop)
    D = forward(evidence.library, evidence.flight, evidence.nuisance.tangents, columns).traces
    return evidence.nuisance.with_torque(evidence.flight, D, P, columns, evidence.null)


def likelihood_gains(
    A: np.ndarray, X: np.ndarray, V: np.ndarray, g: np.ndarray, u: np.ndarray, d: np.ndarray,
    replaced: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:  # fmt: skip
    """Return (free, named, both), each (M,), and the rank of the free form; see the module.

    A (p, p), X (p, K), V (K, K); scores g (M, p), u (M, K) of M flights; d (p,) is zero except
    where ``replaced`` (p,) is True.
    """
    g, u = g + A @ d, u + X.T @ d
    rest = ~replaced
    solved = np.linalg.solve(A[np.ix_(rest, rest)], np.hstack([A[np.ix_(rest, replaced)], X[rest]]))
    n = int(replaced.sum())
    full = np.block([[A[np.ix_(replaced, replaced)], X[replaced]], [X[replaced].T, V]])
    J = full - np.hstack([A[np.ix_(rest, replaced)], X[rest]]).T @ solved
    U = np.hstack([g[:, replaced], u]) - g[:, rest] @ solved
    E = informative_directions(J[n:, n:], V)
    if not E.shape[1]:
        zero = np.zeros(len(g))
        return zero, zero, zero, 0
    free = _quadratic(U[:, n:] @ E, E.T @ J[n:, n:] @ E)
    named = _quadratic(U[:, :n], J[:n, :n])
    P = np.block([[np.eye(n), np.zeros((n, E.shape[1]))], [np.zeros((len(E), n)), E]])
    return free, named, _quadratic(U @ P, P.T @ J @ P), E.shape[1]


def _quadratic(U: np.ndarray, J: np.ndarray) -> np.ndarray:
    """Return Uᵀ J⁺ U for each of the M rows of U; shape (M,)."""
    return np.asarray(np.einsum("mi,ij,mj->m", U, np.linalg.pinv(J, hermitian=True), U))
