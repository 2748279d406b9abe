"""Energy and travel momentum of the emulated rigid body, which free motion conserves."""

from __future__ import annotations

import math

import numpy as np
from heli3dof_drivers.emulator.lagrange import mass_matrix
from heli3dof_drivers.emulator.plant_layout import G_P, T_G


def energy(body: np.ndarray, q: np.ndarray, qd: np.ndarray) -> float:
    """Return kinetic plus potential energy in J for angles ``q`` (rad) and rates ``qd`` (rad/s)."""
    rr, rp, ry, pp, py, yy = mass_matrix(body, q[0], q[1])
    kinetic = 0.5 * (rr * qd[0] ** 2 + pp * qd[1] ** 2 + yy * qd[2] ** 2)
    kinetic += rp * qd[0] * qd[1] + ry * qd[0] * qd[2] + py * qd[1] * qd[2]
    height: float = body[T_G] * math.sin(q[0]) + body[G_P] * math.cos(q[0]) * math.sin(q[1])
    return float(kinetic + height)


def travel_momentum(body: np.ndarray, q: np.ndarray, qd: np.ndarray) -> float:
    """Return the angular momentum about the vertical, ∂T/∂ψ̇, in N·m·s.

    T: kinetic energy; ``q``: angles, rad; ``qd``: rates, rad/s; ``body``: parameters.
    """
    _, _, ry, _, py, yy = mass_matrix(body, q[0], q[1])
    return float(ry * qd[0] + py * qd[1] + yy * qd[2])
