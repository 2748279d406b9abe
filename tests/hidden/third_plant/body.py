"""Kinetics of point masses on an arm, from Jacobians: M(q) q̈ + h(q, q̇) + G(q) = Q.

q = (r, p, ψ) in rad: roll (+: body up), pitch (+: front motor up), yaw (+: counter-clockwise).
Vectors have components along e (outward), t (direction of positive yaw motion) and z (up); e and t
turn with yaw::

    a = (cos r, 0, sin r)                    along the arm, towards the body
    b = (−sin p sin r, cos p, sin p cos r)   from the back to the front motor
    u = (−cos p sin r, −sin p, cos p cos r)  thrust

A mass m at X = α a + β b has the velocity J q̇ and the acceleration J q̈ + c::

    J = (∂X/∂r, ∂X/∂p, z × X)
    c = Σ ∂²X/∂i∂j q̇_i q̇_j + 2 ψ̇ z × v + ψ̇² z × (z × X),   i, j in (r, p),   v = Σ ∂X/∂i q̇_i

    M = Σ m Jᵀ J + diag ΔJ,   h = Σ m Jᵀ c,   G = Σ m g Jᵀ z

Masses (α, β): counterweight m_w (−L_w, 0), motors m_f and m_b (L_a, ± L_h), a weight at the arm's
end (L_a, 0). Lengths in m, masses in kg, ΔJ (`added_inertia`) in kg·m², torques in N·m.
The thrusts F_f, F_b (N) give, by virtual work::

    Q_r = L_a cos p (F_f + F_b)
    Q_p = L_h (F_f − F_b)
    Q_ψ = −L_a cos r sin p (F_f + F_b) + L_h sin r (F_f − F_b)
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tests.hidden.third_plant import kernel

GRAVITY = 9.81
"""m/s², as in the profile"""
FIELDS: tuple[tuple[Any, ...], ...] = (
    *((name, "f8") for name in ("L_w", "L_a", "L_h", "m_w", "m_f", "m_b")),
    ("added_inertia", "f8", 3),
)
"""Fields of a rig's record; `effects` has the others"""


@kernel
def mass_terms(
    x: np.ndarray, rig: Any, weight_kg: float, M: np.ndarray, h: np.ndarray, G: np.ndarray
) -> None:
    """Write the mass matrix M (3, 3), h (3,) and G (3,) for the state ``x`` = (q, q̇, …)."""
    cr, sr, cp, sp = math.cos(x[0]), math.sin(x[0]), math.cos(x[1]), math.sin(x[1])
    dr, dp, dy = x[3], x[4], x[5]
    J, c = np.empty((3, 3)), np.empty(3)
    for i in range(3):
        h[i] = G[i] = 0.0
        for j in range(3):
            M[i, j] = rig.added_inertia[i] if i == j else 0.0
    for point in range(4):
        m, α, β = rig.m_w, -rig.L_w, 0.0
        if point == 1:
            m, α, β = rig.m_f, rig.L_a, rig.L_h
        elif point == 2:
            m, α, β = rig.m_b, rig.L_a, -rig.L_h
        elif point == 3:
            m, α, β = weight_kg, rig.L_a, 0.0
        X_e, X_t, X_z = α * cr - β * sp * sr, β * cp, α * sr + β * sp * cr
        J[0, 0], J[1, 0], J[2, 0] = -X_z, 0.0, X_e
        J[0, 1], J[1, 1], J[2, 1] = -β * cp * sr, -β * sp, β * cp * cr
        J[0, 2], J[1, 2], J[2, 2] = -X_t, X_e, 0.0
        v_e, v_t = J[0, 0] * dr + J[0, 1] * dp, J[1, 1] * dp
        c[0] = -X_e * dr * dr - 2 * β * cp * cr * dr * dp + β * sp * sr * dp * dp
        c[0] += -2 * dy * v_t - dy * dy * X_e
        c[1] = -β * cp * dp * dp + 2 * dy * v_e - dy * dy * X_t
        c[2] = -X_z * dr * dr - 2 * β * cp * sr * dr * dp - β * sp * cr * dp * dp
        for i in range(3):
            G[i] += m * GRAVITY * J[2, i]
            for k in range(3):
                h[i] += m * J[k, i] * c[k]
                for j in range(3):
                    M[i, j] += m * J[k, i] * J[k, j]


@kernel
def inverse(M: np.ndarray) -> np.ndarray:
    """The inverse of a symmetric (3, 3) matrix, by its cofactors."""
    out = np.empty((3, 3))
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            c, d = (j + 1) % 3, (j + 2) % 3
            out[i, j] = M[a, c] * M[b, d] - M[a, d] * M[b, c]
    determinant = M[0, 0] * out[0, 0] + M[0, 1] * out[0, 1] + M[0, 2] * out[0, 2]
    for i in range(9):
        out[i // 3, i % 3] /= determinant
    return out


@kernel
def thrust_torques(x: np.ndarray, front: float, back: float, rig: Any, Q: np.ndarray) -> None:
    """Write the torques Q (3,) of the thrusts."""
    total, difference = front + back, front - back
    Q[0] = rig.L_a * math.cos(x[1]) * total
    Q[1] = rig.L_h * difference
    Q[2] = -rig.L_a * math.cos(x[0]) * math.sin(x[1]) * total
    Q[2] += rig.L_h * math.sin(x[0]) * difference


def inertias(rig: Any) -> np.ndarray:
    """The level rig's J_r, J_p, J_ψ in kg·m², without added inertias."""
    body = rig["m_f"] + rig["m_b"]
    J_r = rig["m_w"] * rig["L_w"] ** 2 + body * rig["L_a"] ** 2
    J_p = body * rig["L_h"] ** 2
    return np.array([J_r, J_p, J_r + J_p])


def trim_torque(rig: Any) -> float:
    """The level arm's gravity torque T_g = (L_a (m_f + m_b) − L_w m_w) g in N·m."""
    return float((rig["L_a"] * (rig["m_f"] + rig["m_b"]) - rig["L_w"] * rig["m_w"]) * GRAVITY)
