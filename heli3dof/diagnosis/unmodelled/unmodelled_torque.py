"""The unknown: is there a torque left that no named cause explains, and what does it depend on?

On each axis a free-form torque f(z) = Σ_j τ_j φ_j(z) of each variable z
(`sensitivity.hat_functions`): angles, rates, voltages, products, time. None is fitted: with
the scores u_j = ∂ ln L/∂τ_j, their information V and the tangents of everything the fit already
holds projected out (Rao's score test),

    S = uᵀ V⁺ u − (1ᵀu)²/(1ᵀV1)  ~  χ²(rank V − 1)            where nothing is left

(a constant torque is no structure). B simulated nulls of the fit give each function's mean score
ū, which is taken off, and each group's κ = mean S_null/(rank − 1), by which S is divided where it
exceeds one; by no less than the fit's own scores scatter in flights of it (where it was not freed
of the filter's bias: where they scatter `DISTRUSTED` times as they should). All groups are put on
one scale, x = −2 ln P(χ² > S/κ); the largest x of a null follows a Gumbel law, which gives the
threshold. The group with the largest x is taken, projected out too, and the rest looked at again.
Where what it leaves is noise slower than the nulls' (`estimate.coloured_noise`), it is taken only
if x is as far with that ρ in κ's place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.screening.gumbel import beyond, gumbel
from heli3dof.diagnosis.sensitivity.hat_functions import KNOTS, Hats, Sums, forward
from heli3dof.diagnosis.sensitivity.residual_torque import SI_UNITS, UNITS, Trail
from heli3dof.diagnosis.unmodelled.similarity import LIKE, named_traces, similarity
from heli3dof.diagnosis.unmodelled.torque_evidence import (
    RANK,
    Evidence,
    Held,
    coloured,
    evidence,
    told,
)
from heli3dof.diagnosis.unmodelled.torque_nulls import Scored, blockwise
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.recording.recording import Recording

MOST = 3
"""Leftovers that are looked for, at most."""
ALSO = 0.5
"""Variables with this share of the best one's x are stated beside it."""
LEAST_SHARE = 0.05
"""Of the residual torque's variance. An encoder's chatter can be sure, and explain nothing."""
FALSE_ALARMS = 0.0005
"""Of recordings where nothing is left. A quantile that few flights extrapolate is no better known
than they are, and what a lab should believe without a name for it stands far above: hundreds."""
FAR = beyond(FALSE_ALARMS)
"""Scales beyond the location of a Gumbel law that is known"""
DISTRUSTED = 2.0
"""Inflation above which flights of a fit that was not freed of its bias are no measure of it."""
WINDOW_S = 0.1


@dataclass(frozen=True, eq=False)
class ResidualTorque:
    """Structure that is left: a torque on ``axis`` that depends on ``depends_on``."""

    axis: str
    depends_on: str
    """One of `sensitivity.residual_torque.UNITS`"""
    share: float
    """Of the variance of the axis' residual torque (averages over `WINDOW_S`) that it explains"""
    table: tuple[tuple[float, float], ...]
    """(value of the variable in rad, rad/s, V, s; torque in N·m), away from its mean"""
    std: tuple[float, ...]
    """N·m, of the table's torques"""
    score: float
    """x, see the module"""
    confidence: float
    """One less the chance that nothing gives as much"""
    also: tuple[str, ...] = ()
    """Other variables that explain as much of it or nearly, the next best first"""
    like: str | None = None
    """A named cause whose trace is nearly the same, as ``friction.viscous.yaw-like``"""
    nearest: str | None = None
    cosine: float = 0.0
    """The named cause whose trace is nearest, and how near; see `leftover_like`"""

    def to_dict(self) -> dict[str, Any]:
        """The contract's entry, and what is known besides."""
        return {
            "axis": self.axis,
            "depends_on": self.depends_on,
            "share": self.share,
            "table": [list(row) for row in self.table],
            "table_std_Nm": list(self.std),
            "unit": SI_UNITS[UNITS[self.depends_on]],
            "score": self.score,
            "confidence": self.confidence,
            "or_depends_on": list(self.also),
            "like": self.like,
        }


def residual_torques(
    found: Estimate, recordings: Sequence[Recording], *, flights: int, seed: int
) -> tuple[ResidualTorque, ...]:
    """What is left in the recordings that ``found`` was fitted to; empty where nothing is.

    ``flights`` simulated nulls, at least `LEAST_FLIGHTS`, where the loop is known; elsewhere the
    scatter of half-second blocks stands in for them, and twice Bonferroni's threshold is asked for.
    """
    return examined(found, recordings, flights=flights, seed=seed)[0]


def examined(
    found: Estimate, recordings: Sequence[Recording], *, flights: int, seed: int
) -> tuple[tuple[ResidualTorque, ...], Held]:
    """The same, and all that was projected out in the end: the fit's coordinates, the leftovers."""
    return significant_torques(evidence(found, recordings, flights=flights, seed=seed))


def significant_torques(seen: Evidence) -> tuple[tuple[ResidualTorque, ...], Held]:
    """The same from what was seen: the group with the largest x, and what is left beside it."""
    found, flight, library, null, held = seen.found, seen.flight, seen.library, seen.null, seen.held
    named: tuple[list[str], np.ndarray] | None = None
    out: list[ResidualTorque] = []
    while len(out) < MOST:
        sums = forward(library, flight, held.tangents) if out else seen.sums
        judged = judge(found, flight, library, sums, held, null)
        sure = [int(q) for q in np.argsort(-judged.x) if judged.x[q] > judged.threshold]
        described = ((q, _describe(flight, library, judged, q)) for q in sure)
        seen_in = ((q, d) for q, d in described if d.share > LEAST_SHARE)
        best, new, D = next(
            (
                t
                for t in (_traced(seen, held, *s) for s in seen_in)
                if _stands(seen, held, judged, *t)
            ),
            (-1, None, np.zeros(0)),
        )
        if new is None:
            break
        columns = np.arange(len(sums.u))[library.columns(best)]
        trace = np.array([torque for _, torque in new.table]) @ D
        if named is None:
            named = named_traces(found)
        name, cos = similarity(named, flight.at, trace, held.tangents, held.A)
        like = f"{name}-like" if cos > LIKE else None
        out.append(replace(new, like=like, nearest=name, cosine=cos))
        held = held.wider(flight, D, judged.directions[best], columns, null)
    return tuple(out), held


def _traced(
    seen: Evidence, held: Held, q: int, new: ResidualTorque
) -> tuple[int, ResidualTorque, np.ndarray]:
    """With the group's traces (KNOTS, E)."""
    columns = np.arange(len(seen.sums.u))[seen.library.columns(q)]
    return q, new, forward(seen.library, seen.flight, held.tangents, columns).traces


def _stands(
    seen: Evidence, held: Held, judged: Judged, q: int, new: ResidualTorque, D: np.ndarray
) -> bool:
    """Whether x is beyond the threshold where the noise is as it is beside this very torque."""
    P = judged.directions[q]
    torque = np.array([f for _, f in new.table])
    rho = coloured(seen.flight, held, D, P, torque, float(judged.white[q]))
    S = float(_statistic(judged.u[q] @ P, P.T @ judged.V[q] @ P)[0])
    x = float(scaled(np.array(S / judged.kappa[q] / rho), P.shape[1]))
    return x > judged.threshold


@dataclass(frozen=True, eq=False)
class Judged:
    """All groups: x and the threshold; efficient scores and informations behind them."""

    x: np.ndarray
    """(groups,)"""
    threshold: float
    location: float
    scale: float
    """Of the Gumbel law"""
    u: np.ndarray
    """(groups, KNOTS)"""
    V: np.ndarray
    """(groups, KNOTS, KNOTS)"""
    kappa: np.ndarray
    """(groups,)"""
    white: np.ndarray
    """(groups,) how much the nulls' scores scatter of what V says, however little"""
    directions: tuple[np.ndarray, ...]
    """(KNOTS, rank) each: what the flight tells of"""


def judge(
    found: Estimate, flight: Trail, library: Hats, sums: Sums, held: Held, null: Scored | None
) -> Judged:
    """Every group against the nulls, or where there are none against the flight's own scatter."""
    groups = len(library.groups)
    X = np.linalg.solve(held.A, sums.cross)
    u = (sums.u - X.T @ held.g).reshape(groups, KNOTS)
    if null is not None:
        un = (null.u - held.g_null @ X).reshape(-1, groups, KNOTS)
        B = len(un)
        mean = un.mean(axis=0)
        u = u - mean
        # Each null against the others, as the flight is against all.
        others = (un - mean) * B / (B - 1)
    else:
        blocks = blockwise(found, flight, library, held.tangents)
        ub = (blocks.u - blocks.g @ X).reshape(-1, groups, KNOTS)
        others = ub - ub.mean(axis=0)
    V = np.empty((groups, KNOTS, KNOTS))
    x, kappa, white = np.zeros(groups), np.ones(groups), np.ones(groups)
    x_null = np.zeros((len(others), groups))
    directions = []
    biased = getattr(found, "bias", None) is None
    distrust = 1.0 if biased and found.inflation <= DISTRUSTED else found.inflation
    for q in range(groups):
        c = library.columns(q)
        V[q] = sums.V[q] - sums.cross[:, c].T @ X[:, c]
        V[q], off = _without_constant(V[q], sums.V[q])
        u[q], others[:, q] = off @ u[q], others[:, q] @ off.T
        E = told(V[q], sums.V[q])
        directions.append(E)
        rank = E.shape[1]
        if rank == 0:
            continue
        V_E = E.T @ V[q] @ E
        S = _statistic(u[q] @ E, V_E)
        Sn = _statistic(others[:, q] @ E, V_E)
        if null is not None:
            white[q] = float(Sn.mean()) / rank
            kappa[q] = max(white[q], 1.0)
            x_null[:, q] = scaled(Sn / kappa[q], rank)
            kappa[q] = max(kappa[q], distrust)
        else:
            m = len(others)
            kappa[q] = max(float(Sn.sum()) / rank * m / max(m - KNOTS, 1), 1.0)
        x[q] = scaled(S / kappa[q], rank)[0]
    if null is not None:
        largest = x_null.max(axis=1)
        location, scale = gumbel(largest, least=2.0)
        scale *= wider(len(largest))
        threshold = location + scale * FAR
    else:
        location, scale = 4 * float(np.log(max(groups, 1))), 4.0
        threshold = -4 * float(np.log(FALSE_ALARMS / max(groups, 1)))
    return Judged(x, threshold, location, scale, u, V, kappa, white, tuple(directions))


def wider(n: int) -> float:
    """By how much the scale of a Gumbel law is to be stretched that n flights' moments tell, so
    that one flight more exceeds `FAR` of it in `FALSE_ALARMS` of cases; unstretched, three times as
    many do where n is 24 and twelve times where it is 8. To 2 % from 8 flights on."""
    return 1 + 4.5 / n + 10 / n**2


def _without_constant(V: np.ndarray, whole: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """V without the constant function, and the (KNOTS, KNOTS) that takes it out of a score."""
    one = np.ones(KNOTS)
    along = V @ one
    size = float(one @ along)
    if size <= RANK * float(np.trace(whole)):  # it is among what is held
        return V, np.eye(KNOTS)
    return V - np.outer(along, along) / size, np.eye(KNOTS) - np.outer(along, one) / size


def _statistic(u: np.ndarray, V: np.ndarray) -> np.ndarray:
    """(…,) uᵀ V⁻¹ u"""
    u = np.atleast_2d(u)
    return np.asarray(np.einsum("bi,bi->b", u, np.linalg.solve(V, u.T).T))


def scaled(S: np.ndarray, rank: int) -> np.ndarray:
    """x = −2 ln P(χ²_rank > S)"""
    from scipy.stats import chi2

    return np.asarray(-2 * chi2.logsf(S, rank))


def _describe(flight: Trail, library: Hats, judged: Judged, best: int) -> ResidualTorque:
    axis, name = library.groups[best]
    E = judged.directions[best]
    inverse = E @ np.linalg.inv(E.T @ judged.V[best] @ E) @ E.T
    torque = inverse @ judged.u[best]
    m = library.variables.index(name)
    left, part = library.place(flight)
    rows = flight.flown & np.isfinite(flight.torque[:, axis])
    at, part = left[rows, m], part[rows, m]
    torque -= float(np.mean(torque[at] * (1 - part) + torque[at + 1] * part))
    f = torque[at] * (1 - part) + torque[at + 1] * part
    std = np.sqrt(judged.kappa[best] * np.diag(inverse))
    same = [q for q in np.argsort(-judged.x) if library.groups[q][0] == axis and q != best]
    enough = max(ALSO * float(judged.x[best]), judged.threshold)
    return ResidualTorque(
        AXES[axis],
        name,
        share_of(flight.torque[rows, axis], f, flight.data.h[rows]),
        tuple((float(z), float(v)) for z, v in zip(library.knots[m], torque, strict=True)),
        tuple(float(v) for v in std),
        float(judged.x[best]),
        float(np.exp(-np.exp(-(judged.x[best] - judged.location) / judged.scale))),
        tuple(library.groups[q][1] for q in same if judged.x[q] > enough),
    )


def share_of(torque: np.ndarray, f: np.ndarray, h: np.ndarray) -> float:
    """1 − var(τ̂ − f)/var(τ̂) of averages over `WINDOW_S`; not below zero."""
    every = max(1, round(WINDOW_S / float(np.median(h))))
    n = len(f) // every
    whole = torque[: n * every].reshape(n, every).mean(axis=1)
    f = f[: n * every].reshape(n, every).mean(axis=1)
    return float(max(0.0, 1 - np.var(whole - f) / max(np.var(whole), 1e-30)))
