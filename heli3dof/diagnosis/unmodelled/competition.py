"""One function without a name in the place of several names: does it explain the flight better?

A torque outside the catalogue may be taken apart into names. k V_f V_b on pitch is, to first order
about hover, a thrust mismatch and a constant torque; together they leave so little that the torque
which `unmodelled.unmodelled_torque` would find beside them is none. So each set s of the names, and
each free-form torque q, compete for the same flight. With the fit's coordinates at d_s from absent,
linearised (`unmodelled.torque_evidence`), the scores where the names are absent are

    g° = g + A d_s,      u° = u + Xᵀ d_s

and, the other coordinates r projected out of everything (U = u° − X_rᵀ A_rr⁻¹ g°_r, and so on),

    named = Gᵀ W⁻¹ G,      free = Uᵀ V⁺ U,      both: of the two together

are what the names, the free form, and both win there: twice a log-likelihood. The names stood in
for q where

    free − named > max((rank V − n_s) ln N, mean + `SPREAD` σ of simulated nulls),
    both − free < max(`KEPT` named, n_s ln N)

(BIC; N events; the nulls fly the fit with its names in it, where their own free form loses as much
as the names' formula is worth). A true cause is not only one more shape of a torque on one axis: it
moves others too, or has a shape that a function of one variable can follow only with more numbers.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.sensitivity.hat_functions import forward
from heli3dof.diagnosis.unmodelled.torque_evidence import Evidence, Held, told
from heli3dof.diagnosis.unmodelled.unmodelled_torque import ResidualTorque, scaled, share_of
from heli3dof.identification.greybox.estimate import Estimate

SPREAD = 6.0
KEPT = 0.25
"""Of what the names won alone: what they still win beside the free form"""


@dataclass(frozen=True)
class Contest:
    """A free-form torque against the names that it would replace."""

    names: tuple[str, ...]
    axis: str
    depends_on: str
    free: float
    named: float
    both: float
    rank: int
    numbers: int
    """n_s, parameters of the names"""
    events: int
    nulls: tuple[float, float]
    """Mean and standard deviation of free − named in the nulls"""

    @property
    def better(self) -> float:
        """free − named, less what the free form's further numbers cost."""
        return self.free - self.named - (self.rank - self.numbers) * float(np.log(self.events))

    @property
    def wins(self) -> bool:
        """True where the names only stood in for it; see the module."""
        mean, std = self.nulls
        bought = self.numbers * float(np.log(self.events))
        sure = self.free - self.named > mean + SPREAD * std
        return self.better > 0 and sure and self.both - self.free < max(KEPT * self.named, bought)


def winning_torque(seen: Evidence, names: Sequence[str]) -> Contest | None:
    """The best of those that win against any of the names; None where the names stand.

    None too where the loop is unknown: without nulls there is no telling what a free form wins.
    """
    if seen.null is None or not names:
        return None
    winners = (r for r in rivals(seen, names) if r.wins)
    return max(winners, key=lambda r: r.better, default=None)


def rivals(seen: Evidence, names: Sequence[str]) -> Iterator[Contest]:
    """Every set of the names against every group of the library."""
    null, held = seen.null, seen.held
    assert null is not None
    B = len(null.u)
    mean_g, mean_u = held.g_null.mean(axis=0), null.u.mean(axis=0)
    # Each null against the others, as the flight is against all.
    alone = B / (B - 1)
    g = np.vstack([held.g - mean_g, (held.g_null - mean_g) * alone])
    u = np.vstack([seen.sums.u - mean_u, (null.u - mean_u) * alone])
    for count in range(1, len(names) + 1):
        for some in itertools.combinations(names, count):
            gone = np.array([f.term in some for f in seen.found.free])
            d = away(seen.found) * gone
            for q, (axis, variable) in enumerate(seen.library.groups):
                c = seen.library.columns(q)
                X, V = seen.sums.cross[:, c], seen.sums.V[q]
                free, named, both, rank = won(held.A, X, V, g, u[:, c], d, gone)
                if rank:
                    less = (free - named)[1:]
                    yield Contest(
                        some, AXES[axis], variable, float(free[0]), float(named[0]),
                        float(both[0]), rank, int(gone.sum()), max(len(seen.flight.at.row), 2),
                        (float(less.mean()), float(less.std(ddof=1))),
                    )  # fmt: skip


def away(found: Estimate) -> np.ndarray:
    """(p,) the way from each term's absence to where it is, along its first parameter's tangent."""
    d, seen = np.zeros(len(found.free)), set[str]()
    for j, (f, v) in enumerate(zip(found.free, found.values, strict=True)):
        if f.term is not None and f.term not in seen:
            seen.add(f.term)
            d[j] = (float(v) - f.null) / f.slope(float(v))
    return d


def as_leftover(seen: Evidence, best: Contest) -> ResidualTorque:
    """The free form itself, as it is where the names are absent: what is left beside no name.

    Its share is of the residual torque that it leaves and its own together; its confidence the odds
    of it against the names, both as likely before: 1/(1 + exp(−better/2)).
    """
    null, held, library, flight = seen.null, seen.held, seen.library, seen.flight
    assert null is not None
    axis = AXES.index(best.axis)
    q = library.groups.index((axis, best.depends_on))
    c = library.columns(q)
    gone = np.array([f.term in best.names for f in seen.found.free])
    d = away(seen.found) * gone
    g = held.g - held.g_null.mean(axis=0) + held.A @ d
    u = (seen.sums.u - null.u.mean(axis=0))[c] + seen.sums.cross[:, c].T @ d
    X = seen.sums.cross[~gone][:, c]
    solved = np.linalg.solve(held.A[np.ix_(~gone, ~gone)], X)
    V = seen.sums.V[q] - X.T @ solved
    E = told(V, seen.sums.V[q])
    inverse = E @ np.linalg.inv(E.T @ V @ E) @ E.T
    torque = inverse @ (u - solved.T @ g[~gone])
    m = library.variables.index(best.depends_on)
    left, part = (a[:, m] for a in library.place(flight))
    rows = flight.flown & np.isfinite(flight.torque[:, axis])
    f = (torque[left] * (1 - part) + torque[left + 1] * part)[rows]
    rest = flight.torque[rows, axis]
    return ResidualTorque(
        best.axis,
        best.depends_on,
        share_of(rest + f - f.mean(), f - f.mean(), flight.data.h[rows]),
        tuple(
            (float(z), float(v)) for z, v in zip(library.knots[m], torque - f.mean(), strict=True)
        ),
        tuple(float(v) for v in np.sqrt(np.diag(inverse))),
        float(scaled(np.array([best.free - best.named]), best.rank)[0]),
        float(1 / (1 + np.exp(-min(best.better, 200.0) / 2))),
        like=f"{best.names[0]}-like",
    )


def held_with(seen: Evidence, best: Contest) -> Held:
    """What is held once the free form is taken beside the names."""
    q = seen.library.groups.index((AXES.index(best.axis), best.depends_on))
    c = seen.library.columns(q)
    X, V = seen.sums.cross[:, c], seen.sums.V[q]
    P = told(V - X.T @ np.linalg.solve(seen.held.A, X), V)
    columns = np.arange(c.start, c.stop)
    D = forward(seen.library, seen.flight, seen.held.tangents, columns).traces
    return seen.held.wider(seen.flight, D, P, columns, seen.null)


def won(
    A: np.ndarray, X: np.ndarray, V: np.ndarray, g: np.ndarray, u: np.ndarray, d: np.ndarray,
    gone: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:  # fmt: skip
    """(free, named, both) (M,) each, and the free form's rank; see the module.

    A (p, p), X (p, K), V (K, K); scores g (M, p), u (M, K) of M flights; d (p,), zero but where
    ``gone`` (p,) bool.
    """
    g, u = g + A @ d, u + X.T @ d
    rest = ~gone
    solved = np.linalg.solve(A[np.ix_(rest, rest)], np.hstack([A[np.ix_(rest, gone)], X[rest]]))
    n = int(gone.sum())
    full = np.block([[A[np.ix_(gone, gone)], X[gone]], [X[gone].T, V]])
    J = full - np.hstack([A[np.ix_(rest, gone)], X[rest]]).T @ solved
    U = np.hstack([g[:, gone], u]) - g[:, rest] @ solved
    E = told(J[n:, n:], V)
    if not E.shape[1]:
        zero = np.zeros(len(g))
        return zero, zero, zero, 0
    free = _quadratic(U[:, n:] @ E, E.T @ J[n:, n:] @ E)
    named = _quadratic(U[:, :n], J[:n, :n])
    P = np.block([[np.eye(n), np.zeros((n, E.shape[1]))], [np.zeros((len(E), n)), E]])
    return free, named, _quadratic(U @ P, P.T @ J @ P), E.shape[1]


def _quadratic(U: np.ndarray, J: np.ndarray) -> np.ndarray:
    """(M,) Uᵀ J⁺ U"""
    return np.asarray(np.einsum("mi,ij,mj->m", U, np.linalg.pinv(J, hermitian=True), U))
