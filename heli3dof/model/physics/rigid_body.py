"""The nonlinear rigid body: an arm that turns in roll and yaw and carries a bar that pitches.

r, p, ψ are roll, pitch, yaw (rad). The bar, also called the body, carries one motor at each end,
L_h (m) from its centre. It has rotational inertia only about axes perpendicular to itself. Its
angular velocity about these axes is

    ω_a = ṗ + sin r ψ̇                    along the arm
    ω_n = sin p ṙ + cos r cos p ψ̇        along the body's normal

All other masses are part of the arm. The bar's mass acts on the arm like a point mass at the arm's
end. With J_a = J_ψ − J_p the kinetic energy T and the potential energy U are

    2 T = J_r ṙ² + J_a cos² r ψ̇² + J_p (ω_a² + ω_n²)        U = T_g sin r + G_p cos r sin p

- J_r, J_p, J_ψ (kg·m²): inertias about the three axes of the level rig. J_p and J_ψ contain only
  the masses that the profile lists
- T_g (N·m): gravity torque of the level arm
- G_p = (m_f − m_b) g L_h (N·m): gravity torque of the level body, with the masses m_f, m_b (kg) of
  the front and the back motor

A real rig has further parts, such as a rotor, a drum or a counterweight on the shaft. δJ_p and δJ_ψ
are the inertias of these parts about the pitch and the yaw axis. They occur only in the elements
M_pp and M_ψψ of the mass matrix M. Lagrange's equations M(q) q̈ + h(q, q̇) = Q have

    M_rr = J_r + J_p sin² p           M_rψ = J_p cos r sin p cos p
    M_pp = J_p + δJ_p                 M_pψ = J_p sin r              M_rp = 0
    M_ψψ = J_a cos² r + J_p (sin² r + cos² r cos² p) + δJ_ψ

Here α_a and α_n are the parts of ω̇_a and ω̇_n that do not contain angular accelerations:

    α_a = cos r ṙ ψ̇        α_n = cos p ṗ ṙ − (sin r cos p ṙ + cos r sin p ṗ) ψ̇

    h_r = J_p (sin p α_n + ω_n (cos p ṗ + sin r cos p ψ̇) − ω_a cos r ψ̇) + J_a cos r sin r ψ̇²
    h_p = J_p (α_a − ω_n (cos p ṙ − cos r sin p ψ̇))
    h_ψ = J_p (sin r α_a + ω_a cos r ṙ + cos r cos p α_n − ω_n (sin r cos p ṙ + cos r sin p ṗ))
          − 2 J_a cos r sin r ṙ ψ̇

The thrusts F_f (front) and F_b (back) act along the normal at the bar's ends. L_a (m) is the
distance from the yaw axis to the bar. With F = F_f + F_b, D = F_f − F_b (N)::

    Q_r = L_a cos p F − T_g cos r + G_p sin r sin p + effects
    Q_p = L_h D − G_p cos r cos p + effects
    Q_ψ = −L_a cos r sin p F + L_h sin r D + effects

For small pitch and slow yaw these are the usual textbook equations, on roll for example
J_r r̈ = L_a cos p F − T_g cos r. The motors' mass difference acts through its weight only; its
product of inertia, (m_f − m_b) L_a L_h, is neglected. Rotors: see `heli3dof.model.physics.rotor`.

In the rest of this text, J_p and J_ψ include δJ_p and δJ_ψ. τ_r, τ_p, τ_ψ (N·m) are the torques of
effects (`heli3dof.model.effects`) on the three axes.

**Hover model.** The equations to first order about level hover, where F = T_g/L_a and D = G_p/L_h:

    J_r r̈ = L_a F − T_g + τ_r      J_p p̈ = L_h D − G_p + τ_p      J_ψ ψ̈ = −T_g p + G_p r + τ_ψ

These are the paper's eqs (10) and (11), with errata E3 and E4 corrected. The paper has
T_g = 2 L_a K_f V_o, with each motor's thrust per volt K_f (N/V) and hover voltage V_o (V). It
assumes equal motors, so G_p = 0. The simulated acceleration is

    q̈ = (1 − λ) q̈_rigid + λ q̈_hover

with the accelerations q̈_rigid of the rigid body and q̈_hover of the hover model. The weight λ is
element `LINEAR` of the parameter array s (`state_layout`). In a model without the effect
``base.hover``, λ is 0. In a model with ``base.hover``, λ is 1. If this model also has the effect
``geometry``, λ is 1 − a, where a is the parameter of ``geometry``.

**Simplified equations.** Four further elements of s select simplified equations: κ `UNCOUPLED`,
ν `CONSTANT_YAW_INERTIA`, μ `WITHOUT_RATE_PRODUCTS`, η `SIDE_THRUST`. Each is the parameter of an
effect `simplified.*`, and 0 in a model without this effect. The following acceleration q̈ replaces
q̈_rigid, also in the equation with λ:

    q̈ = (1 − κ) q̈_rigid + κ q̈_alone + ν (0, 0, τ_y/J_ψ − ψ̈_alone)

q̈_alone are the accelerations if each axis moves alone, without inertia coupling to the others:

    J_r r̈ = L_a cos p F − T_g cos r + G_p sin r sin p + τ_r − (1 − μ) J_r sin r cos r ψ̇²
    J_p p̈ = L_h D − G_p cos r cos p + τ_p + (1 − μ) J_p sin p cos p (ṙ² − cos² r ψ̇²)
    ((J_ψ − J_p) cos² r + J_p) ψ̈ = τ_y + (1 − μ) 2 (J_ψ − J_p) sin r cos r ṙ ψ̇
    τ_y = −L_a cos r sin p F + η L_h sin r D + τ_ψ

The value 0 keeps the equations of the rigid body. The value 1 has this meaning:

- κ = 1 omits M_rψ, M_pψ, the term J_p sin² p of M_rr, the torque L_h sin r D, and the products of
  rates that q̈_alone does not contain. The largest omitted torque is M_pψ ψ̈ on pitch, up to
  0.01 N·m.
- ν = 1 omits the dependence of the yaw inertia on roll, for any κ. With κ = 1, the yaw equation is
  then J_ψ ψ̈ = τ_y.
- μ = 1, together with κ = 1, omits all products of rates.
- η = 1, together with κ = 1, keeps the torque L_h sin r D.

**Not identifiable from flights.** If all torques and inertias are multiplied by the same factor,
the motion does not change. So no flight determines the thrust per volt K_f. The fits use the
profile's K_f. If the true K_f is 1.1 times this value, the true T_g, J_r, J_p, J_ψ and torques of
effects are 1.1 times their estimates. The profile's masses, or the known weight of one part,
determine this factor.
"""

from __future__ import annotations

import math
from typing import Any

from heli3dof.model.compiled import inlined
from heli3dof.model.physics import state_layout as _s
from heli3dof.model.physics.compiled_effects import caller

R, P, R_DOT, P_DOT, PSI_DOT = _s.R, _s.P, _s.R_DOT, _s.P_DOT, _s.PSI_DOT
L_A, L_H, T_G, G_P, LINEAR = _s.L_A, _s.L_H, _s.T_G, _s.G_P, _s.LINEAR
UNCOUPLED, CONSTANT_YAW_INERTIA, WITHOUT_RATE_PRODUCTS, SIDE_THRUST = (
    _s.UNCOUPLED,
    _s.CONSTANT_YAW_INERTIA,
    _s.WITHOUT_RATE_PRODUCTS,
    _s.SIDE_THRUST,
)
J_R, J_P, J_PSI = _s.J_R, _s.J_P, _s.J_PSI
BODY_P, BODY_PSI = _s.BODY_P, _s.BODY_PSI
F_FRONT, F_BACK = _s.F_FRONT, _s.F_BACK
SPEED_FRONT, SPEED_BACK = _s.SPEED_FRONT, _s.SPEED_BACK
K_F, GAIN_FRONT, GAIN_BACK = _s.K_F, _s.GAIN_FRONT, _s.GAIN_BACK
THRUST, TORQUE = int(_s.Stage.THRUST), int(_s.Stage.TORQUE)

call = caller()


@inlined
def simplified(s: Any, force: Any, torque: Any, free: Any, a: Any) -> None:
    """Replace the accelerations ``a`` (3,) of the rigid body by simplified ones, fully or partly.

    Elements of ``s`` determine the part, for example ``s[UNCOUPLED]``. Each is the parameter of an
    effect `simplified.*`. 0 keeps the rigid body's acceleration, 1 replaces it, and values between
    interpolate. The head of this file contains the equations ("Simplified equations"). The
    arguments are those of `body_accelerations`.
    """
    sr, cr = math.sin(s[R]), math.cos(s[R])
    sp, cp = math.sin(s[P]), math.cos(s[P])
    rd, yd = s[R_DOT], s[PSI_DOT]
    F, D = force[0] + force[1], force[0] - force[1]
    J_a = s[J_PSI] - s[J_P]
    roll = (s[L_A] * cp * F - s[T_G] * cr + s[G_P] * sr * sp + torque[0]) / s[J_R]
    rate_products = 1.0 - s[WITHOUT_RATE_PRODUCTS]
    roll -= rate_products * sr * cr * yd * yd
    pitch = (s[L_H] * D - s[G_P] * cr * cp + torque[1]) / s[J_P]
    pitch += rate_products * sp * cp * (rd * rd - cr * cr * yd * yd)
    t_y = -s[L_A] * cr * sp * F + s[SIDE_THRUST] * s[L_H] * sr * D + torque[2]
    yaw = (t_y + rate_products * 2.0 * J_a * sr * cr * rd * yd) / (J_a * cr * cr + s[J_P])
    if free[0]:
        a[0] += s[UNCOUPLED] * (roll - a[0])
    if free[1]:
        a[1] += s[UNCOUPLED] * (pitch - a[1])
    if free[2]:
        a[2] += s[UNCOUPLED] * (yaw - a[2]) + s[CONSTANT_YAW_INERTIA] * (t_y / s[J_PSI] - yaw)


@inlined
def body_accelerations(s: Any, force: Any, torque: Any, free: Any, a: Any) -> None:
    """Write the angular accelerations (3,) rad/s² of the rigid body to ``a``.

    s: rig parameters and state; ``force`` (2,) N: thrusts; ``torque`` (3,) N·m: the effects'
    torques. An axis that is not ``free`` is fixed: its acceleration is zero.
    """
    sr, cr = math.sin(s[R]), math.cos(s[R])
    sp, cp = math.sin(s[P]), math.cos(s[P])
    rd, pd, yd = s[R_DOT], s[P_DOT], s[PSI_DOT]
    Jr, Jp, Ja = s[J_R], s[BODY_P], s[BODY_PSI] - s[BODY_P]
    L_a, L_h = s[L_A], s[L_H]
    F, D = force[0] + force[1], force[0] - force[1]
    w_a = pd + sr * yd
    w_n = sp * rd + cr * cp * yd
    a_a = cr * rd * yd
    turn = sr * cp * rd + cr * sp * pd
    a_n = cp * pd * rd - turn * yd
    h_r = Jp * (sp * a_n + w_n * (cp * pd + sr * cp * yd) - w_a * cr * yd) + Ja * cr * sr * yd * yd
    h_p = Jp * (a_a - w_n * (cp * rd - cr * sp * yd))
    h_y = Jp * (sr * a_a + w_a * cr * rd + cr * cp * a_n - w_n * turn)
    h_y -= 2.0 * Ja * cr * sr * rd * yd
    b_r = L_a * cp * F - s[T_G] * cr + s[G_P] * sr * sp + torque[0] - h_r
    b_p = L_h * D - s[G_P] * cr * cp + torque[1] - h_p
    b_y = -L_a * cr * sp * F + L_h * sr * D + torque[2] - h_y
    m_rr = Jr + Jp * sp * sp
    m_ry = Jp * cr * sp * cp
    m_pp = s[J_P]
    m_py = Jp * sr
    m_yy = Ja * cr * cr + Jp * (sr * sr + cr * cr * cp * cp) + s[J_PSI] - s[BODY_PSI]
    if not free[0]:
        m_ry, b_r = 0.0, 0.0
    if not free[1]:
        m_py, b_p = 0.0, 0.0
    if not free[2]:
        m_ry, m_py, b_y = 0.0, 0.0, 0.0
    # M_rp = 0: eliminate roll and pitch from the yaw row.
    u, v = m_ry / m_rr, m_py / m_pp
    yaw = (b_y - u * b_r - v * b_p) / (m_yy - u * m_ry - v * m_py)
    a[0] = (b_r - m_ry * yaw) / m_rr
    a[1] = (b_p - m_py * yaw) / m_pp
    a[2] = yaw
    if s[UNCOUPLED] != 0.0 or s[CONSTANT_YAW_INERTIA] != 0.0:
        simplified(s, force, torque, free, a)
    if s[LINEAR] != 0.0:
        hover = (L_a * F - s[T_G] + torque[0]) / Jr if free[0] else 0.0
        a[0] += s[LINEAR] * (hover - a[0])
        hover = (L_h * D - s[G_P] + torque[1]) / m_pp if free[1] else 0.0
        a[1] += s[LINEAR] * (hover - a[1])
        hover = (-s[T_G] * s[P] + s[G_P] * s[R] + torque[2]) / s[J_PSI] if free[2] else 0.0
        a[2] += s[LINEAR] * (hover - a[2])


@inlined
def accelerations(s, first, address, par, mem, free, force, torque, a):  # type: ignore[no-untyped-def]
    """Write the angular accelerations (3,) rad/s² of the rig with its effects to ``a``.

    ``force`` (2,) and ``torque`` (3,) are work space; ``s`` … ``free``: see
    `heli3dof.model.physics.integrator`.
    """
    force[0], force[1] = s[F_FRONT], s[F_BACK]
    s[SPEED_FRONT] = s[F_FRONT] / (s[K_F] * s[GAIN_FRONT])
    s[SPEED_BACK] = s[F_BACK] / (s[K_F] * s[GAIN_BACK])
    for i in range(first[THRUST], first[THRUST + 1]):
        call(address, i, s, par, mem, force)
    torque[0] = torque[1] = torque[2] = 0.0
    if first[TORQUE + 1] > first[TORQUE]:
        # Torque effects read the thrusts after the thrust effects.
        s[F_FRONT], s[F_BACK] = force[0], force[1]
        for i in range(first[TORQUE], first[TORQUE + 1]):
            call(address, i, s, par, mem, torque)
    body_accelerations(s, force, torque, free, a)


@inlined
def advance(s, x, h, F0, Fm, F1, first, address, par, mem, free, w):  # type: ignore[no-untyped-def]
    """Advance angles and rates x (6,) by h s with the thrusts F0, Fm, F1 (2,) N.

    F0, Fm, F1 are the thrusts at the start, the middle and the end of the step. The Runge–Kutta–
    Nyström method integrates the accelerations at these three times with Simpson's weights. Other
    values of the thrusts are not used, which causes an error of order h⁵. w (≥ 5, 3) is work space.
    `heli3dof.model.physics.integrator` explains the other arguments.
    """
    force, torque, a0, am, a1 = w[0], w[1], w[2], w[3], w[4]
    for i in range(6):
        s[R + i] = x[i]
    s[F_FRONT], s[F_BACK] = F0[0], F0[1]
    accelerations(s, first, address, par, mem, free, force, torque, a0)
    for i in range(3):
        s[R + i] = x[i] + 0.5 * h * x[3 + i] + 0.125 * h * h * a0[i]
        s[R_DOT + i] = x[3 + i] + 0.5 * h * a0[i]
    s[F_FRONT], s[F_BACK] = Fm[0], Fm[1]
    accelerations(s, first, address, par, mem, free, force, torque, am)
    for i in range(3):
        s[R + i] = x[i] + h * x[3 + i] + 0.5 * h * h * am[i]
        s[R_DOT + i] = x[3 + i] + h * am[i]
    s[F_FRONT], s[F_BACK] = F1[0], F1[1]
    accelerations(s, first, address, par, mem, free, force, torque, a1)
    for i in range(3):
        x[i] += h * x[3 + i] + h * h / 6.0 * (a0[i] + 2.0 * am[i])
        x[3 + i] += h / 6.0 * (a0[i] + 4.0 * am[i] + a1[i])
