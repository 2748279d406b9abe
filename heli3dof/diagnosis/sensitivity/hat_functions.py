"""A library of free-form torques: hat functions of each variable, on each axis.

    f(z) = Σ_j τ_j φ_j(z),      φ_j falls linearly from 1 at knot j to 0 at its neighbours

`KNOTS` knots stand evenly between the `EDGE` quantiles of the variable along the flight; beyond
them f stays what it is at the last knot. A group is one variable on one axis: `KNOTS` columns.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from heli3dof.diagnosis.sensitivity.residual_torque import UNITS, Trail

KNOTS = 9
EDGE = 0.005
LEAST = {"°": 0.005, "°/s": 0.02, "V": 0.2, "V²": 1.0, "V/s": 2.0, "s": 2.0}
"""rad, rad/s, V, V², V/s, s: a variable that moves less than this is no variable."""
LEAST_PRODUCT = 1e-3


@dataclass(frozen=True, eq=False)
class Hats:
    """M variables on a number of axes: a function's column is (axis M + variable) KNOTS + knot."""

    variables: tuple[str, ...]
    axes: np.ndarray
    """which of roll, pitch, yaw"""
    knots: np.ndarray
    """(M, KNOTS)"""

    @property
    def groups(self) -> tuple[tuple[int, str], ...]:
        """(axis, variable) of each group"""
        return tuple((int(a), v) for a in self.axes for v in self.variables)

    def columns(self, group: int) -> slice:
        return slice(group * KNOTS, (group + 1) * KNOTS)

    def place(self, flight: Trail) -> tuple[np.ndarray, np.ndarray]:
        """(left (N, M) int, share (N, M)): the knot below, and how far towards the next."""
        N, M = len(flight.data.t), len(self.variables)
        left, share = np.zeros((N, M), dtype=np.int64), np.zeros((N, M))
        for m, name in enumerate(self.variables):
            low, high = self.knots[m, 0], self.knots[m, -1]
            z = np.nan_to_num(flight.variable(name), nan=low)
            at = np.clip((z - low) / (high - low), 0.0, 1.0) * (KNOTS - 1)
            left[:, m] = np.minimum(at.astype(np.int64), KNOTS - 2)
            share[:, m] = at - left[:, m]
        return left, share

    def scores(self, flight: Trail, blocks: np.ndarray | None = None) -> np.ndarray:
        """(J,) ∂ ln L/∂τ_j; with ``blocks`` (N,) numbers from 0, the sum in each: (blocks, J)."""
        left, share = self.place(flight)
        from heli3dof.diagnosis.sensitivity.residual_torque_passes import gather

        nu = np.where(flight.flown[:, None], flight.gradients[0], 0.0)
        which = np.zeros(len(nu), dtype=np.int64) if blocks is None else blocks
        J = len(self.axes) * left.shape[1] * KNOTS
        out = np.zeros((int(which.max()) + 1, J))
        gather(nu, self.axes, which, left, share, KNOTS, out)
        return out[0] if blocks is None else out


def hats(flight: Trail, axes: np.ndarray) -> Hats:
    """The library for a flight: the variables that move in it."""
    names, knots = [], []
    for name, unit in UNITS.items():
        z = flight.variable(name)[flight.flown]
        z = z[np.isfinite(z)]
        if not len(z):
            continue
        low, high = np.quantile(z, [EDGE, 1 - EDGE])
        if high - low > LEAST.get(unit, LEAST_PRODUCT):
            names.append(name)
            knots.append(np.linspace(low, high, KNOTS))
    return Hats(tuple(names), np.asarray(axes, dtype=np.int64), np.array(knots))


@dataclass(frozen=True, eq=False)
class Sums:
    """Forward sums over a flight's events for J functions; see `torque_passes.forced`."""

    u: np.ndarray
    """(J,) scores"""
    V: np.ndarray
    """(groups, KNOTS, KNOTS) their information"""
    cross: np.ndarray
    """(p, J) with the tangents"""
    traces: np.ndarray
    """(wanted, E)"""


def forward(
    library: Hats, flight: Trail, tangents: np.ndarray, wanted: np.ndarray | None = None
) -> Sums:
    """All functions in one pass beside ``tangents`` (p, E); ``wanted`` are columns to keep."""
    from heli3dof.diagnosis.sensitivity.residual_torque_passes import forced

    left, share = library.place(flight)
    d, at = flight.data, flight.at
    groups = len(library.groups)
    keep = np.zeros(0, dtype=np.int64) if wanted is None else np.asarray(wanted, dtype=np.int64)
    u, V = np.zeros(groups * KNOTS), np.zeros((groups, KNOTS, KNOTS))
    cross, traces = np.zeros((len(tangents), groups * KNOTS)), np.zeros((len(keep), len(at.row)))
    forced(
        d.blocks, d.h, flight.A, flight.B, flight.slope, at.row, at.state, at.g, at.w, at.K,
        left, share, np.ascontiguousarray(tangents), library.axes, keep, KNOTS, u, V, cross, traces,
    )  # fmt: skip
    return Sums(u, V, cross, traces)
