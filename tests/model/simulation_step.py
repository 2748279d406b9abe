"""One step of the simulation, without filters."""

from __future__ import annotations

import numpy as np

from heli3dof.model.greybox.linearisation import _Plant
from heli3dof.model.physics.integrator import step


def stepped(plant: _Plant, z: np.ndarray, V: np.ndarray, h: float) -> np.ndarray:
    """The angles (rad), rates (rad/s) and thrusts (N) z (8,) after ``h`` s with V (2,) V."""
    x, F = z[:6].copy(), z[6:8].reshape(1, 2).copy()
    w, cache = np.zeros((8, 3)), np.full(6, -1.0)
    step(
        plant.s, x, 0, np.zeros(1), np.array([h]), V.reshape(1, 2),
        plant.steady_thrusts(V).reshape(1, 2), F, *plant.effects, plant.free, w, cache,
    )  # fmt: skip
    return np.concatenate([x, w[7, :2]])
