"""Estimate a residual torque (a torque that the fitted model lacks) over time.

The angles of roll, pitch and yaw are q (rad). The filter's process noise is a white angular
acceleration of intensity a² ((rad/s²)²/Hz). Bryson and Frazier's smoother estimates this
acceleration d and the residual torque τ at sample k:

    d̂_k = a²/h ∂ ln L/∂q̈_k  (rad/s²),        τ̂_k = M(q_k) d̂_k  (N·m)

h (s) is the time to the next sample, L the likelihood, M (kg·m²) the mass matrix. τ̂ is accurate
below the filter's bandwidth (a few Hz) and attenuated above it.

**Hat functions.** z is one of the variables in `UNITS`: an angle, a rate, a voltage or its
derivative, a product of these, or the time. A torque that is a piecewise linear function of z is

    f(z) = Σ_j τ_j φ_j(z)  (N·m),      φ_j falls linearly from 1 at knot j to 0 at its neighbours

The `KNOTS` knots are evenly spaced between the quantiles `TAIL` and 1 − `TAIL` of z in the flight.
Beyond the outer knots f is constant. The `KNOTS` hat functions φ_j of one variable on one axis form
a group.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.model.effects.empirical import KNOTS
from heli3dof.model.estimation.ekf_quantised import FilterRun
from heli3dof.model.estimation.filter_data import Data

UNITS = {
    "roll": "°", "pitch": "°", "yaw": "°",
    "roll_rate": "°/s", "pitch_rate": "°/s", "yaw_rate": "°/s",
    "voltage_front": "V", "voltage_back": "V", "voltage_sum": "V", "voltage_difference": "V",
    "voltage_product": "V²", "voltage_sum_slope": "V/s", "voltage_difference_slope": "V/s",
    "time": "s",
    "roll*pitch": "rad²", "roll*pitch_rate": "rad²/s", "pitch*roll_rate": "rad²/s",
    "roll_rate*pitch_rate": "rad²/s²", "roll_rate*yaw_rate": "rad²/s²",
    "pitch_rate*yaw_rate": "rad²/s²", "pitch*voltage_sum": "rad V", "roll*voltage_sum": "rad V",
}  # fmt: skip
"""The variables on which a residual torque may depend, with their display units"""
SLOPE_S = 0.04  # interval of the difference quotient in `LinearisedRun.slope_of`, chosen
TAIL = 0.005  # share of the samples beyond each outer knot, chosen
MIN_RANGE = {"°": 0.005, "°/s": 0.02, "V": 0.2, "V²": 1.0, "V/s": 2.0, "s": 2.0}
"""{display unit: least range of a variable between the outer knots, in SI units}. Chosen."""
MIN_RANGE_PRODUCT = 1e-3  # the same for the products


@dataclass(frozen=True, eq=False)
class LinearisedRun:
    """A run of the Kalman filter over N rows of data, and the model's derivatives in each row.

    The model's equations are linearised at the state that the filter estimated in this row. q (rad)
    are the angles, q̇ and q̈ their rates and accelerations, τ (N·m) the torques on the axes.
    """

    data: Data
    at: FilterRun
    """The filter's states, and its updates by encoder readings"""
    A: np.ndarray
    """(N, 3, 6) ∂q̈/∂(q, q̇)"""
    B: np.ndarray
    """(N, 3, 3) ∂q̈/∂τ, 1/(kg·m²)"""
    slope: np.ndarray
    """(N, 3) ∂reading/∂angle"""
    q_ddot: np.ndarray
    """(N, 3) rad/s², the model's acceleration"""
    noise: np.ndarray
    """(4,) process noise a of roll, pitch, yaw (rad/s²/√Hz) and sampling jitter (s)"""

    @property
    def X(self) -> np.ndarray:
        """Return the filter's states (N, 6) in rad, rad/s."""
        assert self.at.X is not None
        return np.asarray(self.at.X[:, :6])

    @cached_property
    def in_runs(self) -> np.ndarray:
        """Return (N,) bool: the rows of the runs (usable intervals), except each run's last row."""
        out = np.zeros(len(self.data.t), dtype=bool)
        for _, start, stop in self.data.blocks:
            out[start : stop - 1] = True
        return out

    @cached_property
    def gradients(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the derivatives of the log-likelihood with respect to torque and acceleration.

        The result contains two arrays (N, 3), one value for each row and axis. The first is the
        derivative with respect to the torque, in 1/(N·m). The second is the derivative with respect
        to the acceleration, in s²/rad.
        """
        from heli3dof.diagnosis.unmodelled.residual_torque_passes import gradient

        d, at = self.data, self.at
        nu, mu = np.zeros_like(self.slope), np.zeros_like(self.slope)
        gradient(
            d.blocks, d.h, self.A, self.B, self.slope, at.row, at.state, at.g, at.w, at.K, nu, mu
        )
        return nu, mu

    @cached_property
    def torque(self) -> np.ndarray:
        """Return the residual torque τ̂ (N, 3) N·m; NaN outside the runs and on unmeasured axes."""
        _, mu = self.gradients
        d = mu * self.noise[:3] ** 2 / self.data.h[:, None]
        out = np.full_like(d, np.nan)
        out[self.in_runs] = self.as_torque(d)[self.in_runs]
        return np.asarray(out)

    def as_torque(self, q_ddot: np.ndarray) -> np.ndarray:
        """Return the torques (N, 3) N·m of accelerations (N, 3) rad/s²; NaN on unmeasured axes."""
        measured = np.zeros((len(q_ddot), 3), dtype=bool)
        for free, (_, start, stop) in zip(self.data.free, self.data.blocks, strict=True):
            measured[start:stop] = free
        # An unmeasured axis has a row of zeros in B.
        B = self.B + np.where(measured, 0.0, 1.0)[:, :, None] * np.eye(3)
        out = np.linalg.solve(B, q_ddot[:, :, None])[:, :, 0]
        out[~measured] = np.nan
        return np.asarray(out)

    def variable(self, name: str) -> np.ndarray:
        """Return the values (N,) of a variable, or of a product of two variables, in SI units.

        ``name`` is a key of `UNITS`, such as ``roll``, or the sine ``sin(roll)``, cosine
        ``cos(roll)`` or absolute value ``abs(roll)`` of such a variable. Two such names can be
        multiplied: ``sin(roll)*pitch``.
        """
        if "*" in name:
            one, other = name.split("*")
            return np.asarray(self.variable(one) * self.variable(other))
        if name.endswith(")"):
            function = {"sin": np.sin, "cos": np.cos, "abs": np.abs}[name[:3]]
            return np.asarray(function(self.variable(name[4:-1])))
        if name.endswith("_slope"):
            return self.slope_of(self.variable(name.removesuffix("_slope")))
        front, back = self.data.V.T
        r, p, psi, r_dot, p_dot, psi_dot = self.X.T
        table = {
            "roll": r, "pitch": p, "yaw": psi,
            "roll_rate": r_dot, "pitch_rate": p_dot, "yaw_rate": psi_dot,
            "voltage_front": front, "voltage_back": back,
            "voltage_sum": front + back, "voltage_difference": front - back,
            "voltage_product": front * back, "time": self.data.t,
        }  # fmt: skip
        return np.asarray(table[name])

    def slope_of(self, x: np.ndarray) -> np.ndarray:
        """Return dx/dt (N,) of x (N,), a central difference over `SLOPE_S` within each run."""
        out = np.zeros(len(x))
        for first, _, stop in self.data.blocks:
            t = self.data.t[first:stop]
            n = max(1, round(0.5 * SLOPE_S / float(np.median(self.data.h[first:stop]))))
            ahead = np.minimum(np.arange(stop - first) + n, stop - first - 1)
            behind = np.maximum(np.arange(stop - first) - n, 0)
            v = x[first:stop]
            out[first:stop] = (v[ahead] - v[behind]) / np.maximum(t[ahead] - t[behind], 1e-9)
        return out


def linearised_run(fit: Estimate) -> LinearisedRun:
    """Return a fit's filter run over its recordings, with the model's derivatives."""
    return linearised_run_at(fit.problem, fit.optimum.theta, fit.optimum.noise)


def linearised_run_at(problem: Likelihood, theta: np.ndarray, noise: np.ndarray) -> LinearisedRun:
    """Return the filter run over the data of ``problem``, with the model's derivatives.

    ``theta`` (n,): the model's parameters. ``noise`` (4,): process noise and sampling jitter, as in
    `LinearisedRun`.
    """
    at = problem.run(theta, noise, keep=2)
    assert at.X is not None
    A, B, slope, q_ddot = along(problem, theta, at.X)
    return LinearisedRun(problem.data, at, A, B, slope, q_ddot, np.asarray(noise))


def along(
    problem: Likelihood, theta: np.ndarray, X: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the model's derivatives and accelerations at the states X (N, 6).

    They are the arrays ``A``, ``B``, ``slope`` and ``q_ddot`` of `LinearisedRun`. ``theta`` (n,):
    the model's parameters.
    """
    from heli3dof.diagnosis.unmodelled.residual_torque_passes import linear

    d = problem.data
    N = len(d.t)
    A, B = np.zeros((N, 3, 6)), np.zeros((N, 3, 3))
    slope, q_ddot = np.ones((N, 3)), np.zeros((N, 3))
    linear(
        *problem.structure.arguments(problem.values(theta)), d.blocks, d.free, d.t, d.h, d.V,
        X, A, B, slope, q_ddot,
    )  # fmt: skip
    return A, B, slope, q_ddot


@dataclass(frozen=True, eq=False)
class Hats:
    """Hat (triangular) functions of M variables on A axes: basis functions of a residual torque.

    Each hat function is a torque on one axis, and depends on one variable, such as an angle. It is
    1 at one of the variable's `KNOTS` knots. From there it falls linearly to 0 at the neighbouring
    knots. Axes, variables and knots are counted from zero. The hat function of a given axis,
    variable and knot has the index (axis · M + variable) · `KNOTS` + knot.
    """

    variables: tuple[str, ...]
    axes: np.ndarray
    """(A,) indices of the axes: 0 roll, 1 pitch, 2 yaw"""
    knots: np.ndarray
    """(M, KNOTS), SI units"""

    @property
    def groups(self) -> tuple[tuple[int, str], ...]:
        """Return (index of the axis, variable) of each group of `KNOTS` hat functions."""
        return tuple((int(a), v) for a in self.axes for v in self.variables)

    def columns(self, group: int) -> slice:
        return slice(group * KNOTS, (group + 1) * KNOTS)

    def knot_positions(self, flight: LinearisedRun) -> tuple[np.ndarray, np.ndarray]:
        """Return the knot below each variable z, and the position of z between two knots.

        Both arrays are (N, M), for N rows and M variables. The position is the fraction, from 0 to
        1, of the way from that knot to the next one.
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
        """Return the scores ∂ ln L/∂τ_j (J,) of the J hat functions' coefficients τ_j.

        ``blocks`` (N,) gives the block number of each row. With it, the result has the shape
        (B, J): a row of scores for each of B blocks.
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
    """Return hat functions of each variable whose range in the flight exceeds `MIN_RANGE`.

    Each hat function is a torque on one axis; ``axes`` (A,): indices of these axes.
    """
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
    """(p, J) information shared by the fit's p parameters and the functions"""


def hat_scores(library: Hats, flight: LinearisedRun, tangents: np.ndarray) -> HatScores:
    """Return scores and information of the coefficients of all hat functions in ``library``.

    ``tangents`` (p, E): derivatives of the E predicted encoder readings with respect to the fit's p
    parameters.
    """
    return _forward_pass(library, flight, tangents, np.empty((0, len(flight.at.row))))


def hat_sensitivities(library: Hats, flight: LinearisedRun, group: int) -> np.ndarray:
    """Return derivatives (KNOTS, E) of E predicted readings with respect to torque coefficients.

    The torque acts on one axis and is a piecewise linear function of one variable. The coefficients
    are the torques (N·m) at its `KNOTS` knots. ``group``: index of the axis and the variable in
    ``library.groups``.
    """
    axis, variable = library.groups[group]
    m = library.variables.index(variable)
    one = Hats((variable,), np.array([axis], dtype=np.int64), library.knots[m : m + 1])
    E = len(flight.at.row)
    sensitivities = np.zeros((KNOTS, E))
    _forward_pass(one, flight, np.empty((0, E)), sensitivities)
    return sensitivities


def _forward_pass(
    library: Hats, flight: LinearisedRun, tangents: np.ndarray, sensitivities: np.ndarray
) -> HatScores:
    """Return `hat_scores`; write the derivatives of the readings to ``sensitivities``.

    They are the derivatives (J, E) of E predicted encoder readings with respect to the coefficients
    of J hat functions. If ``sensitivities`` has the shape (0, E), they are not written.
    """
    from heli3dof.diagnosis.unmodelled.residual_torque_passes import sum_hat_scores

    left, share = library.knot_positions(flight)
    d, at = flight.data, flight.at
    groups = len(library.groups)
    u, V = np.zeros(groups * KNOTS), np.zeros((groups, KNOTS, KNOTS))
    cross = np.zeros((len(tangents), groups * KNOTS))
    sum_hat_scores(
        d.blocks, d.h, flight.A, flight.B, flight.slope, at.row, at.state, at.g, at.w, at.K,
        left, share, np.ascontiguousarray(tangents), library.axes, KNOTS, u, V, cross,
        sensitivities,
    )  # fmt: skip
    return HatScores(u, V, cross)
