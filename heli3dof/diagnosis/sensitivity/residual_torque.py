"""Residual torque: what the fitted rig lacks, in N·m, instant by instant, and what it may follow.

The filter drives each axis with white acceleration of intensity a²; what it finds there, given
all of the flight, is the smoother's estimate (Bryson and Frazier's form)

    d̂_k = a²/h ∂ ln L/∂q̈_k  (rad/s²),        τ̂_k = B_k⁻¹ d̂_k  (N·m),   B = M(q)⁻¹

with the gradient of one backward pass (`sensitivity.residual_torque_passes`). It is
unbiased below the bandwidth of the filter (some Hz) and attenuated above it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.likelihood import Likelihood, Pass
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
"""What a torque may depend on, and the unit in which people read it."""
SI_UNITS = {unit: unit.replace("°", "rad") for unit in set(UNITS.values())}
"""The same in SI, as in tables"""
SLOPE_S = 0.04


@dataclass(frozen=True, eq=False)
class Trail:
    """A flight as the fitted rig's filter saw it, linearised along the way; N rows, E events."""

    data: Data
    at: Pass
    A: np.ndarray
    """(N, 3, 6) ∂q̈/∂(q, q̇)"""
    B: np.ndarray
    """(N, 3, 3) ∂q̈/∂τ, 1/(kg·m²)"""
    slope: np.ndarray
    """(N, 3) ∂reading/∂angle"""
    q_ddot: np.ndarray
    """(N, 3) rad/s², the rig's own acceleration"""
    noise: np.ndarray
    """(4,) as `Optimum.noise`"""

    @property
    def X(self) -> np.ndarray:
        """(N, 6) rad, rad/s"""
        assert self.at.X is not None
        return np.asarray(self.at.X[:, :6])

    @cached_property
    def flown(self) -> np.ndarray:
        """(N,) bool: rows of a run, with a row after them."""
        out = np.zeros(len(self.data.t), dtype=bool)
        for _, start, stop in self.data.blocks:
            out[start : stop - 1] = True
        return out

    @cached_property
    def gradients(self) -> tuple[np.ndarray, np.ndarray]:
        """(ν, μ), each (N, 3): ∂ ln L/∂τ_k and ∂ ln L/∂q̈_k."""
        from heli3dof.diagnosis.sensitivity.residual_torque_passes import gradient

        d, at = self.data, self.at
        nu, mu = np.zeros_like(self.slope), np.zeros_like(self.slope)
        gradient(
            d.blocks, d.h, self.A, self.B, self.slope, at.row, at.state, at.g, at.w, at.K, nu, mu
        )
        return nu, mu

    @cached_property
    def torque(self) -> np.ndarray:
        """(N, 3) N·m, the residual torque; NaN outside the runs and on axes that do not move."""
        _, mu = self.gradients
        d = mu * self.noise[:3] ** 2 / self.data.h[:, None]
        out = np.full_like(d, np.nan)
        out[self.flown] = self.as_torque(d)[self.flown]
        return np.asarray(out)

    def as_torque(self, q_ddot: np.ndarray) -> np.ndarray:
        """(N, 3) N·m that accelerate so, rad/s² (N, 3); NaN on an axis that is held."""
        moves = np.zeros((len(q_ddot), 3), dtype=bool)
        for free, (_, start, stop) in zip(self.data.free, self.data.blocks, strict=True):
            moves[start:stop] = free
        # An axis that is held has a row of zeros in B.
        B = self.B + np.where(moves, 0.0, 1.0)[:, :, None] * np.eye(3)
        out = np.linalg.solve(B, q_ddot[:, :, None])[:, :, 0]
        out[~moves] = np.nan
        return np.asarray(out)

    def variable(self, name: str) -> np.ndarray:
        """(N,) one of `UNITS`, in rad, rad/s, V, s; a product is written with ``*``."""
        if "*" in name:
            one, other = name.split("*")
            return np.asarray(self.variable(one) * self.variable(other))
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
        """(N,) of x per second, over `SLOPE_S` about each row; runs are kept apart."""
        out = np.zeros(len(x))
        for first, _, stop in self.data.blocks:
            t = self.data.t[first:stop]
            n = max(1, round(0.5 * SLOPE_S / float(np.median(self.data.h[first:stop]))))
            ahead = np.minimum(np.arange(stop - first) + n, stop - first - 1)
            behind = np.maximum(np.arange(stop - first) - n, 0)
            v = x[first:stop]
            out[first:stop] = (v[ahead] - v[behind]) / np.maximum(t[ahead] - t[behind], 1e-9)
        return out


def trail(found: Estimate, data: Data | None = None) -> Trail:
    """The flight through the fitted rig's filter: the recordings' own, or other ``data``."""
    problem = found.problem if data is None else replace(found.problem, data=data)
    return trail_at(problem, found.optimum.theta, found.optimum.noise)


def trail_at(problem: Likelihood, theta: np.ndarray, noise: np.ndarray) -> Trail:
    """The same at any point: θ (n,) coordinates, ``noise`` (4,)."""
    at = problem.run(theta, noise, keep=2)
    assert at.X is not None
    A, B, slope, q_ddot = along(problem, theta, at.X)
    return Trail(problem.data, at, A, B, slope, q_ddot, np.asarray(noise))


def along(
    problem: Likelihood, theta: np.ndarray, X: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A, B, slope and q̈ of a rig at θ (n,) coordinates that goes through the states X (N, 6)."""
    from heli3dof.diagnosis.sensitivity.residual_torque_passes import linear

    d, hooks = problem.data, problem.structure.hooks
    s, par = problem.structure.arrays(problem.values(theta))
    N = len(d.t)
    A, B = np.zeros((N, 3, 6)), np.zeros((N, 3, 3))
    slope, q_ddot = np.ones((N, 3)), np.zeros((N, 3))
    linear(
        s, hooks.first, hooks.address, par, problem.structure.memory, d.blocks, d.free, d.t, d.h,
        d.V, X, A, B, slope, q_ddot,
    )  # fmt: skip
    return A, B, slope, q_ddot
