"""Piecewise linear torques: a basis of hat functions of each variable, on each axis.

    f(z) = Σ_j τ_j φ_j(z),      φ_j falls linearly from 1 at knot j to 0 at its neighbours

f is a torque (N·m), z a variable of `residual_torque.UNITS`. The `KNOTS` knots are evenly spaced
between z's quantiles `TAIL` and 1 − `TAIL` in the flight; beyond the outer knots f is constant. A
group is one variable on one axis and has `KNOTS` columns.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from heli3dof.diagnosis.unmodelled.residual_torque import UNITS, LinearisedRun
from heli3dof.model.effects.empirical import KNOTS

TAIL = 0.005  # share of the samples beyond each outer knot, chosen
MIN_RANGE = {"°": 0.005, "°/s": 0.02, "V": 0.2, "V²": 1.0, "V/s": 2.0, "s": 2.0}
"""Smallest range of a variable between the outer knots, by unit, in SI units. Chosen."""
MIN_RANGE_PRODUCT = 1e-3  # the same for the products


@dataclass(frozen=True, eq=False)
class Hats:
    """The hat functions of M variables on A axes.

    The function of an axis, a variable and a knot is column (axis · M + variable) · `KNOTS` + knot,
    with indices from zero.
    """

    variables: tuple[str, ...]
    axes: np.ndarray
    """(A,) indices of the axes: 0 roll, 1 pitch, 2 yaw"""
    knots: np.ndarray
    """(M, KNOTS), SI units"""

    @property
    def groups(self) -> tuple[tuple[int, str], ...]:
        """Return (axis, variable) of each group of hat functions."""
        return tuple((int(a), v) for a in self.axes for v in self.variables)

    def columns(self, group: int) -> slice:
        return slice(group * KNOTS, (group + 1) * KNOTS)

    def knot_positions(self, flight: LinearisedRun) -> tuple[np.ndarray, np.ndarray]:
        """Return, for each row and variable z, the knot below z and the way to the next knot.

        Both arrays are (N, M), for N rows and M variables. The way is a fraction of the distance
        between the knots.
        """
        N, M = len(flight.data.t), len(self.variables)
        left, share = np.zeros((N, M), dtype=np.int8), np.zeros((N, M), dtype=np.float32)
        for m, name in enumerate(self.variables):
            low, high = self.knots[m, 0], self.knots[m, -1]
            z = np.nan_to_num(flight.variable(name), nan=low)
            position = np.clip((z - low) / (high - low), 0.0, 1.0) * (KNOTS - 1)
            left[:, m] = np.minimum(position.astype(np.int8), KNOTS - 2)
            share[:, m] = position - left[:, m]
        return left, share

    def scores(self, flight: LinearisedRun, blocks: np.ndarray | None = None) -> np.ndarray:
        """Return the scores ∂ ln L/∂τ_j (J,) of the functions.

        With ``blocks`` (N,), the block number of each row, the scores are (B, J), by block.
        """
        left, share = self.knot_positions(flight)
        from heli3dof.diagnosis.unmodelled.residual_torque_passes import gather

        nu = np.where(flight.in_runs[:, None], flight.gradients[0], 0.0)
        which = np.zeros(len(nu), dtype=np.int64) if blocks is None else blocks
        J = len(self.axes) * left.shape[1] * KNOTS
        out = np.zeros((int(which.max()) + 1, J))
        gather(nu, self.axes, which, left, share, KNOTS, out)
        return out[0] if blocks is None else out


def hats(flight: LinearisedRun, axes: np.ndarray) -> Hats:
    """Return hat functions on ``axes`` of all variables whose range exceeds `MIN_RANGE`."""
    names, knots = [], []
    for name, unit in UNITS.items():
        z = flight.variable(name)[flight.in_runs]
        z = z[np.isfinite(z)]
        if not len(z):
            continue
        low, high = np.quantile(z, [TAIL, 1 - TAIL])
        if high - low > MIN_RANGE.get(unit, MIN_RANGE_PRODUCT):
            names.append(name)
            knots.append(np.linspace(low, high, KNOTS))
    return Hats(tuple(names), np.asarray(axes, dtype=np.int64), np.array(knots))


@dataclass(frozen=True, eq=False)
class HatScores:
    """Scores and information of J hat functions, summed over a flight's E encoder readings."""

    u: np.ndarray
    """(J,) scores"""
    V: np.ndarray
    """(groups, KNOTS, KNOTS) information within each group"""
    cross: np.ndarray
    """(p, J) information between the p tangents and the functions"""
    traces: np.ndarray
    """(wanted, E) changes δc of the predictions by the wanted functions"""


def sums_along(
    library: Hats, flight: LinearisedRun, tangents: np.ndarray, wanted: np.ndarray | None = None
) -> HatScores:
    """Return scores and information of all hat functions in ``library``.

    ``tangents`` (p, E): derivatives of the E predictions by the fit's parameters. ``wanted``:
    columns of functions whose changes δc of the predictions are returned; none by default.
    """
    from heli3dof.diagnosis.unmodelled.residual_torque_passes import forced

    left, share = library.knot_positions(flight)
    d, at = flight.data, flight.at
    groups = len(library.groups)
    keep = np.zeros(0, dtype=np.int64) if wanted is None else np.asarray(wanted, dtype=np.int64)
    u, V = np.zeros(groups * KNOTS), np.zeros((groups, KNOTS, KNOTS))
    cross, traces = np.zeros((len(tangents), groups * KNOTS)), np.zeros((len(keep), len(at.row)))
    forced(
        d.blocks, d.h, flight.A, flight.B, flight.slope, at.row, at.state, at.g, at.w, at.K,
        left, share, np.ascontiguousarray(tangents), library.axes, keep, KNOTS, u, V, cross, traces,
    )  # fmt: skip
    return HatScores(u, V, cross, traces)
