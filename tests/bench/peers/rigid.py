"""Equations of motion for peers that fit a plant model: eight states, ten unknown parameters.

Kinetic energy of an arm with inertias J_r, J_ψ and of a body that is a bar of inertia J_p about
its middle, at the arm's end (angles of rig.md; the bar's rate has the components ω_a along the
arm and ω_n along the body's normal)::

    2 T = J_r ṙ² + (J_ψ − J_p) cos² r ψ̇² + J_p (ω_a² + ω_n²)
    ω_a = ṗ + sin r ψ̇,      ω_n = sin p ṙ + cos r cos p ψ̇

    Q_r = L_a cos p F − T_g cos r − k_r sin r − c_r ṙ               F = F_f + F_b
    Q_p = L_h D − k_p sin p − c_p ṗ                                 D = F_f − F_b
    Q_ψ = −L_a cos r sin p F + L_h sin r D − c_ψ ψ̇
    τ_m Ḟ_i = K_f V_i − F_i

Lagrange's equations in (r, p, ψ) reduce to two linear equations for r̈ and ψ̈, which then give p̈.
The state holds f_i = F_i − T_g/(2 L_a), the thrust minus that of hover, so that a flight from rest,
level, starts at zero for every T_g. Voltages and angles do not determine the scale of torque: K_f
stays at its nominal value, and all other parameters are relative to it.
"""

from __future__ import annotations

import math

import numpy as np

NAMES = ("J_r", "J_p", "J_y", "T_g", "k_r", "k_p", "c_r", "c_p", "c_y", "tau_m")
"""Unknown parameters: J in kg·m², T_g and k (per sine of the angle) in N·m, c N·m·s/rad, tau_m s"""
KNOWN = ("L_a", "L_h", "K_f")
"""Known constants in m, m, N/V"""
STATES = ("r", "p", "y", "r_dot", "p_dot", "y_dot", "f_front", "f_back")


def derivative(r, p, y, rd, pd, yd, f_f, f_b, v_f, v_b, P):  # type: ignore[no-untyped-def]
    """Returns (ṙ, ṗ, ψ̇, r̈, p̈, ψ̈, ḟ_f, ḟ_b); P is `NAMES` and then `KNOWN`, as plain floats.

    Nothing depends on y, the yaw angle. The function runs both in Python and under numba.
    """
    J_r, J_p, J_y, T_g, k_r, k_p, c_r, c_p, c_y, tau, L_a, L_h, K_f = P
    sr, cr, sp, cp = math.sin(r), math.cos(r), math.sin(p), math.cos(p)
    hover = T_g / (2 * L_a)
    F, D = f_f + f_b + 2 * hover, f_f - f_b
    Q_r = L_a * cp * F - T_g * cr - k_r * sr - c_r * rd
    Q_p = L_h * D - k_p * sp - c_p * pd
    Q_y = -L_a * cr * sp * F + L_h * sr * D - c_y * yd
    A = J_y - J_p
    w_a, w_n = pd + sr * yd, sp * rd + cr * cp * yd
    # d(ω_a)/dt = p̈ + sin r ψ̈ + alpha,  d(ω_n)/dt = sin p r̈ + cos r cos p ψ̈ + beta
    alpha = cr * rd * yd
    beta = cp * pd * rd - sr * cp * rd * yd - cr * sp * pd * yd
    # The equation for p gives J_p d(ω_a)/dt = X directly.
    X = Q_p + J_p * w_n * (cp * rd - cr * sp * yd)
    dT_dr = -A * cr * sr * yd * yd + J_p * yd * (w_a * cr - w_n * sr * cp)
    R = Q_r + dT_dr - J_p * (w_n * cp * pd + sp * beta)
    Y = Q_y - sr * X - J_p * w_a * cr * rd + 2 * A * cr * sr * rd * yd
    Y += J_p * (w_n * (sr * cp * rd + cr * sp * pd) - cr * cp * beta)
    m_rr, m_ry, m_yy = J_r + J_p * sp * sp, J_p * sp * cr * cp, cr * cr * (A + J_p * cp * cp)
    det = m_rr * m_yy - m_ry * m_ry
    rdd, ydd = (m_yy * R - m_ry * Y) / det, (m_rr * Y - m_ry * R) / det
    pdd = X / J_p - sr * ydd - alpha
    return (
        rd, pd, yd, rdd, pdd, ydd,
        (K_f * v_f - f_f - hover) / tau, (K_f * v_b - f_b - hover) / tau,
    )  # fmt: skip


def linearised(values: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns A (8, 8), B (8, 2) of ẋ = A x + B (V − V_h) about level hover (voltage V_h).

    They are computed by central differences.
    """
    P = (*map(float, values), *map(float, known))
    V_h = P[3] / (2 * P[10] * P[12])
    z0 = np.array([0.0] * 8 + [V_h, V_h])

    def f(z: np.ndarray) -> np.ndarray:
        return np.array(derivative(*z.tolist(), P))

    h = 1e-6
    J = np.array([(f(z0 + h * e) - f(z0 - h * e)) / (2 * h) for e in np.eye(10)]).T
    return J[:, :8], J[:, 8:]
