"""Equations of motion of the rigid body, derived from its Lagrangian.

Generalised coordinates q = (r, p, ψ) in rad: elevation of the arm, tilt of the body about the
arm, travel about the vertical. With e_z up and ψ counter-clockwise::

    e_a = (cos r cos ψ, cos r sin ψ, sin r)      along the arm, towards the body
    e_t = (−sin ψ, cos ψ, 0)                     the direction of positive travel
    e_n = e_a × e_t                              upwards when level
    b   =  cos p e_t + sin p e_n                 from the pitch axis to the front motor
    n   = −sin p e_t + cos p e_n                 the body's normal: thrust acts along it

Point masses: the counterweight m_w at −L_w e_a, the motors m_f, m_b at L_a e_a ± L_h b.
The body's angular velocity, in its own axes (e_a, b, n)::

    ω_a = ṗ + sin r ψ̇
    ω_b = −cos p ṙ + cos r sin p ψ̇
    ω_n =  sin p ṙ + cos r cos p ψ̇

The inertias, in kg·m², are J_w = m_w L_w², I_aa = (m_f + m_b) L_h², I_bb = (m_f + m_b) L_a²,
I_nn = I_aa + I_bb and the product of inertia I_ab = −(m_f − m_b) L_a L_h. The kinetic energy T is::

    2 T = J_w (ṙ² + cos² r ψ̇²) + I_aa ω_a² + I_bb ω_b² + I_nn ω_n² + 2 I_ab ω_a ω_b
          + ΔJ_r ṙ² + ΔJ_p ṗ² + ΔJ_ψ ψ̇²  =  q̇ᵀ M(q) q̇

(the ΔJ are rotary inertias on the joints' shafts, from the profile's ``[inertia]`` or an effect).
Potential energy: U = T_g sin r + G_p cos r sin p, with T_g the gravity torque of the level arm and
G_p = (m_f − m_b) g L_h. The masses in the paper's Table I give T_g the wrong sign (erratum E2 in
docs/explanation/paper.md). So T_g is 2 L_a K_f V_o, K_f the thrust per volt: the measured hover
voltage V_o on both motors balances it. Lagrange's equations, with ψ cyclic::

    M q̈ + (∂M/∂r ṙ + ∂M/∂p ṗ) q̇ − ½ (q̇ᵀ ∂M/∂r q̇, q̇ᵀ ∂M/∂p q̇, 0) + ∂U/∂q = Q

Q from the thrusts F_f, F_b (N) by virtual work at their points of action::

    Q_r = L_a cos p (F_f + F_b)
    Q_p = L_h (F_f − F_b)
    Q_ψ = −L_a cos r sin p (F_f + F_b) + L_h sin r (F_f − F_b)

At positive pitch, the thrust turns the rig clockwise; the paper's equation (10) has the wrong sign
(erratum E3).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .plant_layout import DJ_P, DJ_PSI, DJ_R, G_P, I_AA, I_AB, I_BB, I_NN, J_W, L_A, L_H, T_G


@njit(cache=True)
def mass_matrix(body: np.ndarray, r: float, p: float) -> tuple[float, ...]:
    """Return the mass matrix in kg·m² as its elements (rr, rp, rψ, pp, pψ, ψψ).

    ``r``, ``p``: roll and pitch, rad; ``body``: the body's parameters (`plant_layout`).
    """
    sr, cr, sp, cp = math.sin(r), math.cos(r), math.sin(p), math.cos(p)
    Iaa, Ibb, Inn, Iab = body[I_AA], body[I_BB], body[I_NN], body[I_AB]
    return (
        body[J_W] + Ibb * cp * cp + Inn * sp * sp + body[DJ_R],
        -Iab * cp,
        (Inn - Ibb) * cr * sp * cp - Iab * cp * sr,
        Iaa + body[DJ_P],
        Iaa * sr + Iab * cr * sp,
        body[J_W] * cr * cr
        + Iaa * sr * sr
        + cr * cr * (Ibb * sp * sp + Inn * cp * cp)
        + 2 * Iab * sr * cr * sp
        + body[DJ_PSI],
    )


@njit(cache=True)
def velocity_torques(
    body: np.ndarray, r: float, p: float, rd: float, pd: float, yd: float
) -> tuple[float, float, float]:
    """Return the Coriolis and centrifugal torques of roll, pitch and yaw in N·m.

    These torques are on the left side of Lagrange's equations. ``r``, ``p``: roll and pitch, rad;
    ``rd``, ``pd``, ``yd``: rates of roll, pitch and yaw, rad/s; ``body``: parameters.
    """
    sr, cr, sp, cp = math.sin(r), math.cos(r), math.sin(p), math.cos(p)
    Iaa, Ibb, Inn, Iab = body[I_AA], body[I_BB], body[I_NN], body[I_AB]
    # ∂M/∂r: the entries rr, rp and pp do not depend on r.
    r_ry = -(Inn - Ibb) * sr * sp * cp - Iab * cp * cr
    r_py = Iaa * cr - Iab * sr * sp
    r_yy = 2 * sr * cr * (Iaa - body[J_W] - Ibb * sp * sp - Inn * cp * cp)
    r_yy += 2 * Iab * (cr * cr - sr * sr) * sp
    # ∂M/∂p: the entry pp does not depend on p.
    p_rr = 2 * (Inn - Ibb) * sp * cp
    p_rp = Iab * sp
    p_ry = (Inn - Ibb) * cr * (cp * cp - sp * sp) + Iab * sp * sr
    p_py = Iab * cr * cp
    p_yy = 2 * cr * cr * sp * cp * (Ibb - Inn) + 2 * Iab * sr * cr * cp
    # Ṁ q̇
    m_rr, m_rp = p_rr * pd, p_rp * pd
    m_ry, m_py, m_yy = r_ry * rd + p_ry * pd, r_py * rd + p_py * pd, r_yy * rd + p_yy * pd
    h_r = m_rr * rd + m_rp * pd + m_ry * yd
    h_p = m_rp * rd + m_py * yd
    h_y = m_ry * rd + m_py * pd + m_yy * yd
    # − ½ q̇ᵀ ∂M/∂q q̇
    h_r -= r_ry * rd * yd + r_py * pd * yd + 0.5 * r_yy * yd * yd
    h_p -= 0.5 * p_rr * rd * rd + p_rp * rd * pd + p_ry * rd * yd + p_py * pd * yd
    h_p -= 0.5 * p_yy * yd * yd
    return h_r, h_p, h_y


@njit(cache=True)
def gravity(body: np.ndarray, r: float, p: float) -> tuple[float, float]:
    """Return the derivatives (∂U/∂r, ∂U/∂p) in N·m of the potential energy U.

    ``r``, ``p``: roll and pitch, rad; ``body``: the body's parameters (`plant_layout`).
    """
    lean = body[G_P] * math.cos(p) * math.cos(r)
    return body[T_G] * math.cos(r) - body[G_P] * math.sin(r) * math.sin(p), lean


@njit(cache=True)
def solve(m: tuple[float, ...], x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return M⁻¹ (x, y, z) by Cramer's rule; ``m``: the mass matrix M, from `mass_matrix`."""
    rr, rp, ry, pp, py, yy = m
    a, b, c = pp * yy - py * py, ry * py - rp * yy, rp * py - ry * pp
    d, e, f = rr * yy - ry * ry, rp * ry - rr * py, rr * pp - rp * rp
    k = 1.0 / (rr * a + rp * b + ry * c)
    return (
        k * (a * x + b * y + c * z),
        k * (b * x + d * y + e * z),
        k * (c * x + e * y + f * z),
    )


@njit(cache=True)
def accelerations(
    body: np.ndarray,
    q: np.ndarray,
    qd: np.ndarray,
    F_front: float,
    F_back: float,
    torque: np.ndarray,
    out: np.ndarray,
) -> None:
    """Write the accelerations of roll, pitch and yaw in rad/s² to ``out`` (3,).

    ``q``: angles, rad; ``qd``: rates, rad/s; ``F_front``, ``F_back``: thrusts, N; ``torque`` (3,):
    other torques, N·m; ``body``: parameters.
    """
    r, p = q[0], q[1]
    h_r, h_p, h_y = velocity_torques(body, r, p, qd[0], qd[1], qd[2])
    g_r, g_p = gravity(body, r, p)
    F, D = F_front + F_back, F_front - F_back
    L_a, L_h = body[L_A], body[L_H]
    Q_r = L_a * math.cos(p) * F
    Q_p = L_h * D
    Q_y = -L_a * math.cos(r) * math.sin(p) * F + L_h * math.sin(r) * D
    m = mass_matrix(body, r, p)
    out[0], out[1], out[2] = solve(
        m,
        Q_r + torque[0] - h_r - g_r,
        Q_p + torque[1] - h_p - g_p,
        Q_y + torque[2] - h_y,
    )
