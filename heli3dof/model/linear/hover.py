"""The paper's linear hover model, eqs (3)–(14): as printed, and corrected.

Numbers in parentheses are equations of the paper (docs/explanation/paper.md). At hover the torques
balance (4): ``2 L_a K_f V_o = (L_w m_w − L_a m_f − L_a m_b) g`` (5). Small motions about hover obey
``ẋ = A x + B (V − V_o)``, ``y = C x`` (1) with the state x = (r, p, ψ, ṙ, ṗ, ψ̇) (8)::

    J_roll  r̈ =  L_a K_f (V_F + V_B − 2 V_o)       J_roll  = m_w L_w² + (m_f + m_b) L_a²
    J_pitch p̈ =  L_h K_f (V_F − V_B)               J_pitch = (m_f + m_b) L_h²
    J_yaw   ψ̈ = −2 L_a K_f V_o p                   J_yaw   = J_roll + J_pitch

=====================  =================  =======================================================
symbol                 unit               meaning
=====================  =================  =======================================================
r, p, ψ                rad                roll (elevation), pitch (tilt), yaw (travel)
V_F, V_B               V                  front and back motor voltage
V_o                    V                  voltage per motor at hover, eq (6)
L_a, L_h, L_w          m                  yaw axis to body, body to motor, yaw axis to counterweight
m_f, m_b, m_w          kg                 masses of front and back motor, and of the counterweight
K_f                    N/V                thrust per volt
J_roll, J_pitch, J_yaw kg·m²              moments of inertia, the denominators of (10) and (11)
=====================  =================  =======================================================

``printed=True`` gives (10) and (11) as the paper prints them, with its errata: A[6,2] with a plus
sign (E3), and B[5,·] divided by L_h once too often (E4). In the corrected model, A[6,2] is
−2 L_a K_f V_o / J_yaw: at a pitch angle p, the hover thrust 2 K_f V_o has a horizontal component,
which accelerates yaw. V_o is the hover voltage in the profile. The paper computes V_o from the
masses by (6), but the result can have the wrong sign (E2). The paper assumes equal motors and
writes 2 m_f; the corrected model has m_f + m_b.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from heli3dof.model.linear.model import LinearModel
from heli3dof.rig.profile import Profile, g


@dataclass(frozen=True, eq=False)
class Hover:
    """The hover model in continuous time, with its hover voltage.

    A (6, 6), B (6, 2), C (3, 6); states in rad and rad/s, input V − V_o in V.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    V_o: float
    """V, hover voltage of each motor"""


def quiescent_voltage(profile: Profile) -> float:
    """Return the hover voltage (V) of each motor, computed from the masses by the paper's eq (6).

    The result can have the wrong sign (erratum E2). Eq (6) gives a positive voltage if the gravity
    torque of the counterweight exceeds that of the body. But then the rotors must push downwards.
    """
    return profile.gravity_torque / (2 * profile.geometry.L_a * profile.motor.K_f)


def hover(profile: Profile, *, printed: bool = False) -> Hover:
    """Return the paper's hover model, matrices (10)–(13), for a rig.

    With ``printed``, the matrices have the paper's errata, and the hover voltage V_o is from its
    eq (6). Otherwise the errata are corrected, and V_o is the profile's.
    """
    if printed:
        return _as_printed(profile)
    L_a, L_h, K_f = profile.geometry.L_a, profile.geometry.L_h, profile.motor.K_f
    V_o = profile.motor.V_o
    J_roll, J_pitch, J_yaw = profile.inertias
    A = np.zeros((6, 6))
    A[0:3, 3:6] = np.eye(3)
    A[5, 1] = -2 * L_a * K_f * V_o / J_yaw  # (10), sign corrected: E3
    B = np.zeros((6, 2))
    B[3, :] = L_a * K_f / J_roll  # (11)
    B[4, :] = L_h * K_f / J_pitch, -L_h * K_f / J_pitch  # (11), = K_f / (2 m_f L_h): E4
    return Hover(A, B, np.eye(3, 6), V_o)


def _as_printed(profile: Profile) -> Hover:
    L_w, L_a, L_h = profile.geometry.L_w, profile.geometry.L_a, profile.geometry.L_h
    m_w, m_f, m_b = profile.mass.m_w, profile.mass.m_f, profile.mass.m_b
    K_f = profile.motor.K_f
    # Row 6 of (10) and rows 4 and 5 of (11), exactly as printed.
    J_roll = m_w * L_w**2 + 2 * m_f * L_a**2
    J_yaw = m_w * L_w**2 + 2 * m_f * L_h**2 + 2 * m_f * L_a**2
    A = np.zeros((6, 6))
    A[0:3, 3:6] = np.eye(3)
    A[5, 1] = (L_w * m_w - L_a * m_f - L_a * m_b) * g / J_yaw
    B = np.zeros((6, 2))
    B[3, :] = L_a * K_f / J_roll
    B[4, :] = K_f / (2 * m_f * L_h**2), -K_f / (2 * m_f * L_h**2)
    return Hover(A, B, np.eye(3, 6), quiescent_voltage(profile))


def hover_model(profile: Profile, *, printed: bool = False, dt: float | None = None) -> LinearModel:
    """Return the hover model, sampled at the control rate (or every ``dt`` s) with zero-order hold.

    With ``printed`` the model has the paper's errata, else they are corrected. The states are roll,
    pitch, yaw (rad) and their rates (rad/s). The trim u0 is the hover voltage V_o of each motor;
    y0 is zero. The Kalman gain K is zero and the noise covariance S is NaN, because the paper gives
    no noise.
    """
    from heli3dof.model.discretisation import c2d_zoh

    h = hover(profile, printed=printed)
    dt = profile.dt if dt is None else dt
    A, B = c2d_zoh(h.A, h.B, dt)
    return LinearModel(
        name="hover-printed" if printed else "hover",
        kind="hover_printed" if printed else "hover",
        A=A,
        B=B,
        C=h.C,
        K=np.zeros((6, 3)),
        S=np.full((3, 3), np.nan),
        u0=np.full(2, h.V_o),
        y0=np.zeros(3),
        dt=dt,
        exact_hold=True,
        profile=profile,
    )
