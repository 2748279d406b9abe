"""Provide the paper's identified model, eq (17), as printed and as corrected.

All transfer functions have the same denominator. T(s)_{i,j} is from motor i (1 front, 2 back) to
angle j (1 roll, 2 pitch, 3 yaw), in degrees per volt. The defects of eq (17) (erratum E14):

* The numerator of T_11 begins with 52 s³, that of T_21 with −2.537 s³. The other coefficients of
  T_11 are nearly those of −T_21, so 2.52 s³ is very likely meant: the *corrected* reading.
* T_12 and T_13 have no constant term, but T_22 and T_23 have one.
* A fourth-order model cannot represent the plant, which has six states and an integrator in yaw.
* Both readings, printed and corrected, are unstable in closed loop with the gain K_g.

The model is a `LinearModel` in rad and V: the exact zero-order hold of an eight-state realisation,
because the printed numerators have no common four-state realisation.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

from heli3dof.model.discretisation import c2d_zoh
from heli3dof.model.linear.model import LinearModel
from heli3dof.rig.profile import Profile

DENOMINATOR = (1.0, 1.379, 2.01, 1.072, 0.3533)
"""Coefficients of the common denominator, s⁴ … s⁰"""
NUMERATORS_PRINTED = (
    ((52.0, 6.568, 7.539, 3.989), (0.2395, -0.827, 1.139, 0.0), (-2.821, 0.3479, 1.807, 0.0)),
    (
        (-2.537, -6.706, -8.267, -3.854),
        (-0.6011, 0.5048, -1.381, -0.314),
        (2.19, -0.3158, -1.801, -1.047),
    ),
)
"""[motor][angle] → numerator coefficients of s³ … s⁰, °/V, as the paper prints them"""
T11_CORRECTED = 2.52
"""°/V: coefficient of s³ in T_11 that is very likely meant, in place of the printed 52"""


def numerators_deg(*, corrected: bool = False) -> np.ndarray:
    """Return the numerators (2, 3, 4) of eq (17) in °/V, by motor, angle and power (s³ first).

    ``corrected`` selects the corrected reading of T_11 (front motor to roll), else the printed one.
    """
    num = np.array(NUMERATORS_PRINTED)
    if corrected:
        num[0, 0, 0] = T11_CORRECTED
    return num


def realisation(*, corrected: bool = False) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return eq (17) in state space: A (8, 8), B (8, 2), C (3, 8), in rad and V.

    Each motor has a controllable canonical form with four states. ``corrected`` selects the
    corrected reading of T_11 (front motor to roll), else the printed one.
    """
    num = np.deg2rad(numerators_deg(corrected=corrected))
    companion = np.zeros((4, 4))
    companion[0] = -np.array(DENOMINATOR[1:])
    companion[1:, :-1] = np.eye(3)
    B = np.zeros((8, 2))
    B[0, 0] = B[4, 1] = 1.0
    return la.block_diag(companion, companion), B, np.hstack([num[0], num[1]])


def paper17_model(profile: Profile, *, corrected: bool = False) -> LinearModel:
    """Return eq (17), as printed or ``corrected``, as a discrete-time model about hover.

    The model's sampling interval is the control period of the ``profile``.
    """
    A, B, C = realisation(corrected=corrected)
    A_d, B_d = c2d_zoh(A, B, profile.dt)
    return LinearModel(
        name="paper-17-corrected" if corrected else "paper-17",
        kind="paper17",
        A=A_d,
        B=B_d,
        C=C,
        K=np.zeros((8, 3)),
        S=np.full((3, 3), np.nan),
        u0=np.full(2, profile.motor.V_o),
        y0=np.zeros(3),
        dt=profile.dt,
        extra={
            "defective": "eq (17) of the paper (erratum E14): unstable in the loop with K_g in "
            "every reading, and its fourth order cannot represent the plant",
            "T11_s3": T11_CORRECTED if corrected else 52.0,
        },
        exact_hold=True,
        profile=profile,
    )
