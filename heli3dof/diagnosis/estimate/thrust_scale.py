"""How large K_f is: what no flight can tell, told by how well the profile is known.

All torques and inertias times one number move the same way (`heli3dof.model.physics.rigid_body`),
so a fit gives them in units of K_f: x_i = X_i/k, with k = K_f/K_f,nominal. But the profile gives
nominal values of K_f *and* of T_g, J_roll, J_pitch, J_yaw, each right to about s, half its
``tolerance``, now and then far off (Student's t with ν = `FREEDOM`):

    p(ln k) ∝ t_ν(ln k/s) Π_i t_ν(ln(x_i k/X_i,nominal)/s)

Where all four are high by one factor, K_f is low by it; where one is, that one is. The mean of ln k
scales every torque back to SI, and its standard deviation (2 to 4 % at a tolerance of 15 %) is part
of theirs: weighing one part of the rig would settle it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from heli3dof.identification.greybox.estimate import Estimate

FREEDOM = 3.0
WIDEST = 1.5
"""|ln k| that is thought of: a factor of 4.5."""
TORQUE_UNITS = ("N·m", "kg")
"""A unit that holds one of these grows with K_f."""


@dataclass(frozen=True)
class ThrustScale:
    """k = K_f/K_f,nominal, and the standard deviation of its logarithm."""

    k: float
    std: float

    def applied(self, value: float, std: float, unit: str) -> tuple[float, float]:
        """(value, standard deviation) in SI of a number estimated in units of K_f."""
        if not any(u in unit for u in TORQUE_UNITS):
            return value, std
        return value * self.k, self.k * float(np.hypot(std, value * self.std))


def thrust_scale(found: Estimate) -> ThrustScale:
    """From the four parameters of the base, each by how much it differs from nominal."""
    nominal = np.array([f.start for f in found.free[:4]])
    x = found.values[:4] / nominal
    told = found.std[:4] / np.abs(nominal)
    return of_ratios(x, told, 0.5 * found.structure.profile.tolerance)


def of_ratios(x: np.ndarray, told: np.ndarray, s: float) -> ThrustScale:
    """From ratios to nominal x (4,) known to within ``told`` (4,); s: how well the profile is.

    Ratios that are not positive, and such as the recordings do not tell, say nothing.

    >>> scale = of_ratios(np.full(4, 1 / 1.4), np.zeros(4), 0.075)
    >>> round(scale.k, 1)
    1.4
    """
    u = np.linspace(-WIDEST, WIDEST, 3001)
    log_p = _log_t(u / s)
    for value, error in zip(x, told, strict=True):
        if value > 0:
            width = np.hypot(s, error / value)
            log_p = log_p + _log_t((np.log(value) + u) / width)
    p = np.exp(log_p - log_p.max())
    p /= p.sum()
    mean = float(p @ u)
    return ThrustScale(float(np.exp(mean)), float(np.sqrt(p @ (u - mean) ** 2)))


def _log_t(z: np.ndarray) -> np.ndarray:
    return np.asarray(-0.5 * (FREEDOM + 1) * np.log1p(z**2 / FREEDOM))
