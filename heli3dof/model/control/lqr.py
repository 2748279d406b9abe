"""The LQR gain of a rig: the paper's weights on the corrected hover model and two integrals.

States (r, p, ψ, ṙ, ṗ, ψ̇, ∫r, ∫ψ) about hover, inputs V_F − V_o and V_B − V_o (V)::

    minimise ∫ (xᵀ Q x + uᵀ R u) dt,    Q = diag(100, 1, 10, 0, 0, 2, 10, 0.1)
                                        R = 0.05 (24 V / v_max)² I₂

in radians and seconds. For the rig of the paper's Table I this gives the paper's gain K_g (14) up
to truncated digits. This confirms the errata E3 (a sign in A) and E4 (a factor in B) in
docs/explanation/paper.md.

R is larger for an amplifier with a lower limit v_max (V), so that a step uses the same share of
v_max.
"""

from __future__ import annotations

import numpy as np

from heli3dof.errors import CheckFailed
from heli3dof.model.linear.hover import hover
from heli3dof.rig.profile import K_G, Profile

Q = (100.0, 1.0, 10.0, 0.0, 0.0, 2.0, 10.0, 0.1)
"""Weights of the squared states: 1/rad² (×3), s²/rad² (×3), 1/(rad·s)² (×2); the paper's design."""
R = 0.05
"""1/V², weight of each squared voltage for v_max = `V_MAX`; the paper's design."""
V_MAX = 24.0
"""V, voltage limit of the amplifier of the paper's rig."""
SAME = 0.02
"""A gain counts as K_g up to this relative difference, because the paper truncates K_g's digits."""
DIGITS = 5
"""Significant digits to which a designed gain is rounded."""


def lqr_gain(profile: Profile) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the gain K (2 × 8) for a rig; its rows are for the front and back motor.

    The columns multiply the errors, negative rates and error integrals, as K in the profile's
    ``[controller]``. Raises CheckFailed if no gain exists: at hover voltage V_o = 0 the thrust
    cannot turn the rig in yaw.
    """
    import control

    h = hover(profile)
    A, B = np.zeros((8, 8)), np.zeros((8, 2))
    A[:6, :6], B[:6] = h.A, h.B
    A[6, 0] = A[7, 2] = -1.0  # the integrals are of reference − angle
    weight = R * (V_MAX / profile.motor.v_max) ** 2
    try:
        K, _, _ = control.lqr(A, B, np.diag(Q), weight * np.eye(2))
    except (ValueError, np.linalg.LinAlgError, control.ControlArgument) as error:
        raise CheckFailed(
            f"No LQR gain exists for this rig: {error}",
            cause=f"motor.V_o = {profile.motor.V_o:g} V: yaw turns only by tilting the thrust that "
            "carries the arm.",
            fix="measure motor.V_o (docs/reference/profile.md), "
            "or give a gain: --set controller.K=[[…],[…]]",
        ) from error
    # u = −K x; the columns of the law are errors, −rates and integrals of errors.
    gain = K * np.array([1, 1, 1, 1, 1, 1, -1, -1])
    front, back = (tuple(float(f"{x:.{DIGITS}g}") for x in row) for row in np.asarray(gain))
    return front, back


def is_default_gain(K: tuple[tuple[float, ...], ...]) -> bool:
    """Return True if K (2 × 8) is the paper's gain K_g up to the relative difference `SAME`."""
    return bool(np.allclose(K, K_G, rtol=SAME, atol=0.0))
