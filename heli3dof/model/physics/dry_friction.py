"""Dry friction without smoothing: joints stick at rate zero and slip above the friction torque.

A time step of h s without friction ends at the angles q and rates v. Then joint i, with friction of
at most τ_c (N·m), gets the impulse λ (N·m·s) that would stop it, limited to ±τ_c h. With W = M⁻¹,
the inverse mass matrix, for all joints j

    λ = −clip(v_i/W_ii, ±τ_c h)        v_j ← v_j + W_ji λ        q_j ← q_j + ½ h W_ji λ

For the joint itself this is the soft threshold S(v) = sgn(v) max(|v| − b, 0), b = τ_c h W_ii. A
joint at rest under a torque below τ_c stays at rest, and friction cannot reverse the motion. With
friction in several joints, which W couples, the impulses are iterated until they converge, at most
`SWEEPS` times.

W is diag(1/J) for the hover model (`state_layout.LINEAR`) and diagonal for uncoupled axes
(`UNCOUPLED`); `CONSTANT_YAW_INERTIA` changes W_ψψ (`heli3dof.model.physics.rigid_body`).

In the Kalman filter the rate v before friction is uncertain, with the distribution N(m, σ²). The
rate S(v) after friction and the slope S′ = dS/dv have the expectations E below. Here
α = (b − m)/σ, β = (b + m)/σ, φ is the normal density, Q its upper tail, and u(α) = φ(α) − αQ(α):

    E S = σ (u(α) − u(β))              E S² = σ² (Q(α) − αu(α) + Q(β) − βu(β))
    ρ = E S′ = Q(α) + Q(β)

The mean friction on a rate of uncertain sign is below τ_c. A sticking joint has little uncertainty:
the filter multiplies its row of the covariance by ρ < 1. For σ = 0, E S equals S(m).
"""

from __future__ import annotations

import math

from heli3dof.model.compiled import inlined
from heli3dof.model.physics import state_layout as _s
from heli3dof.model.physics.compiled_effects import caller

R, P, J_R, J_P, J_PSI, LINEAR = _s.R, _s.P, _s.J_R, _s.J_P, _s.J_PSI, _s.LINEAR
BODY_P, BODY_PSI = _s.BODY_P, _s.BODY_PSI
UNCOUPLED, CONSTANT_YAW_INERTIA = _s.UNCOUPLED, _s.CONSTANT_YAW_INERTIA
DRY = int(_s.Stage.DRY)
SQRT2, SQRT2PI = math.sqrt(2.0), math.sqrt(2.0 * math.pi)
CERTAIN = 6.0
"""The sign of a rate v counts as certain if |m| exceeds the threshold b by this many standard
deviations of v; m is the mean of v."""
SWEEPS = 20
"""Largest number of iterations over the joints."""

call = caller()


@inlined
def soft_threshold(m: float, sd: float, b: float) -> tuple[float, float, float]:
    """Return (E S, ρ, Var S): mean, mean slope and variance of a rate S after dry friction.

    The rate v before friction has the distribution N(m, sd²). Dry friction changes it to
    S(v) = sgn(v) max(|v| − b, 0), with the threshold b. The mean slope is ρ = E dS/dv. m, sd and b
    are in rad/s. A fit near zero friction may try b < 0, which accelerates: S(v) = v − b sgn v.
    """
    if abs(m) > max(b, 0.0) + CERTAIN * sd:
        return (m - b if m > 0.0 else m + b), 1.0, sd * sd
    if sd <= 0.0:
        return 0.0, 0.0 if b > 0.0 else 1.0, 0.0
    if b <= 0.0:
        slope = 1.0 - 2.0 * b * math.exp(-0.5 * (m / sd) ** 2) / (SQRT2PI * sd)
        return m - b * math.erf(m / (SQRT2 * sd)), slope, (slope * sd) ** 2
    a, c = (b - m) / sd, (b + m) / sd
    Qa, Qc = 0.5 * math.erfc(a / SQRT2), 0.5 * math.erfc(c / SQRT2)
    ua = math.exp(-0.5 * a * a) / SQRT2PI - a * Qa
    uc = math.exp(-0.5 * c * c) / SQRT2PI - c * Qc
    mean = sd * (ua - uc)
    return mean, Qa + Qc, max(sd * sd * (Qa - a * ua + Qc - c * uc) - mean * mean, 0.0)


@inlined
def apply_dry_friction(s, x, h, first, address, par, mem, free, w):  # type: ignore[no-untyped-def]
    """Apply dry friction to x after a step of h s; return True if any joint has friction.

    x (6,): angles and rates, changed in place. w (≥ 8, 3) is work space; its columns belong to the
    joints (roll, pitch, yaw). Before the call, row 3 of w contains the standard deviations of the
    rates before friction. If the function returns True, the rows of w contain

    - row 2: the mean slope ρ of the rate after friction with respect to the rate before it
      (`soft_threshold`), which is 1 for joints without friction
    - row 3: the variance of the rate after friction; unchanged for joints without friction
    - row 4 + i, for i = 0, 1, 2: W_ji/W_ii in column j, with the inverse mass matrix W

    `heli3dof.model.physics.integrator` explains the other arguments.
    """
    if first[DRY + 1] == first[DRY]:
        return False
    for i in range(3):
        w[0, i] = w[1, i] = 0.0
        w[2, i] = 1.0
    for e in range(first[DRY], first[DRY + 1]):
        call(address, e, s, par, mem, w[0])
    sr, cr, sp, cp = math.sin(x[0]), math.cos(x[0]), math.sin(x[1]), math.cos(x[1])
    Jp, Ja, m_pp = s[BODY_P], s[BODY_PSI] - s[BODY_P], s[J_P]
    m_rr = s[J_R] + Jp * sp * sp
    u = Jp * cr * sp * cp / m_rr if free[0] else 0.0
    v = Jp * sr / m_pp if free[1] else 0.0
    yy = Ja * cr * cr + Jp * (sr * sr + cr * cr * cp * cp) + s[J_PSI] - s[BODY_PSI]
    yy -= u * u * m_rr + v * v * m_pp
    yy = 1.0 / yy if free[2] else 0.0
    rr = u * u * yy + (1.0 / m_rr if free[0] else 0.0)
    pp = v * v * yy + (1.0 / m_pp if free[1] else 0.0)
    w[4, 0], w[4, 1], w[4, 2] = 1.0, u * v * yy / rr if rr > 0.0 else 0.0, 0.0
    w[4, 2] = -u * yy / rr if rr > 0.0 else 0.0
    w[5, 0], w[5, 1], w[5, 2] = u * v * yy / pp if pp > 0.0 else 0.0, 1.0, 0.0
    w[5, 2] = -v * yy / pp if pp > 0.0 else 0.0
    w[6, 0], w[6, 1], w[6, 2] = -u, -v, 1.0
    if s[LINEAR] != 0.0 or s[UNCOUPLED] != 0.0 or s[CONSTANT_YAW_INERTIA] != 0.0:
        shared = (1.0 - s[LINEAR]) * (1.0 - s[UNCOUPLED])
        for i in range(3):
            was = rr if i == 0 else (pp if i == 1 else yy)
            level = 1.0 / s[J_R + i]
            uncoupled, body = level, was
            if i == 2:
                uncoupled = 1.0 / ((s[J_PSI] - s[J_P]) * cr * cr + s[J_P])
                body += s[CONSTANT_YAW_INERTIA] * (level - uncoupled)
            body += s[UNCOUPLED] * (uncoupled - was)
            now = body + s[LINEAR] * (level - body) if free[i] else 0.0
            for j in range(3):
                if j != i and now > 0.0:
                    w[4 + i, j] *= shared * was / now
            if i == 0:
                rr = now
            elif i == 1:
                pp = now
            else:
                yy = now
    dry = 0
    for i in range(3):
        if w[0, i] != 0.0 and free[i]:
            dry += 1
            w[0, i] *= h * (rr if i == 0 else (pp if i == 1 else yy))
        else:
            w[0, i] = 0.0
    if dry == 0:
        return False
    for _ in range(SWEEPS if dry > 1 else 1):
        change = 0.0
        for i in range(3):
            if w[0, i] == 0.0:
                continue
            # w[1]: the change of each joint's rate by its own friction
            alone = x[3 + i] - w[1, i]
            mean, w[2, i], _ = soft_threshold(alone, w[3, i], w[0, i])
            move = mean - x[3 + i]
            w[1, i] += move
            for j in range(3):
                x[3 + j] += w[4 + i, j] * move
            change += abs(move)
        if change < 1e-12:
            break
    for i in range(3):
        if w[0, i] != 0.0:
            _, _, w[3, i] = soft_threshold(x[3 + i] - w[1, i], w[3, i], w[0, i])
            for j in range(3):
                x[j] += 0.5 * h * w[4 + i, j] * w[1, i]
    return True


@inlined
def apply_friction_to_covariance(P, h, w, row):  # type: ignore[no-untyped-def]
    """Apply dry friction to the covariance P (6, 6) of x; w is from `apply_dry_friction`.

    For each joint i: P ← T P Tᵀ, T = I + t e_iᵀ, with t = ∂(Δx)/∂v_i (6,). Δx is the change of x
    by friction, v_i the joint's rate, e_i the unit vector of v_i in x. Then the variance of v_i in
    P is replaced by Var S, the variance of the rate after friction. h (s): step; ``row`` (6,): work
    space.
    """
    for i in range(3):
        rho = w[2, i]
        if rho == 1.0:
            continue
        c = 3 + i
        for n in range(6):
            row[n] = P[c, n]
        for n in range(6):
            t_n = (rho - 1.0) * (w[4 + i, n - 3] if n >= 3 else 0.5 * h * w[4 + i, n])
            for j in range(n + 1):
                t_j = (rho - 1.0) * (w[4 + i, j - 3] if j >= 3 else 0.5 * h * w[4 + i, j])
                P[n, j] += t_n * row[j] + t_j * row[n] + t_n * t_j * row[c]
                P[j, n] = P[n, j]
        P[c, c] += w[3, i] - rho * rho * row[c]
