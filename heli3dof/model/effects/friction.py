"""Effects of friction and drag on an axis."""

from __future__ import annotations

import math
from typing import Any

from heli3dof.axes import AXES
from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import AXIS, J_R, R_DOT, STEPPED, A, Stage

NARROWEST = 0.002
"""rad/s, the constant part of ω_s in `coulomb_dry`"""
REVERSAL_S = 0.004
"""s, the factor of |τ_c|/J in ω_s (`coulomb_dry`)"""


def coulomb_dry(s: Any, par: Any, mem: Any, out: Any) -> None:
    """Dry (Coulomb) friction τ = −τ_c sgn(q̇); it holds a joint at rest against torques up to τ_c.

    τ and τ_c are in N·m; q̇ (rad/s) is the joint's rate. A simulation step does not smooth τ, so a
    joint that sticks does not creep. The step's equations, and those for the uncertain rate in a
    Kalman filter, are in `heli3dof.model.physics.dry_friction`.

    For an acceleration that is computed without a simulation step, the torque is a smooth function
    of the state: −τ_c tanh(q̇/ω_s), ω_s = 0.002 rad/s + 4 ms · |τ_c|/J, with the axis' inertia J. A
    small rate then decays as exp(−t τ_c/(J ω_s)), with τ_c/(J ω_s) < 250 1/s.
    """
    out[int(par[AXIS])] += par[A]


def coulomb_torque(s: Any, par: Any, mem: Any, out: Any) -> None:
    if s[STEPPED] < 0.5:
        i = int(par[AXIS])
        width = NARROWEST + REVERSAL_S * abs(par[A]) / s[J_R + i]
        out[i] -= par[A] * math.tanh(s[R_DOT + i] / width)


def viscous(s: Any, par: Any, mem: Any, out: Any) -> None:
    """Viscous friction torque τ = −c q̇ on an axis with the rate q̇ (rad/s), c in N·m·s/rad."""
    i = int(par[AXIS])
    out[i] -= par[A] * s[R_DOT + i]


def quadratic_drag(s: Any, par: Any, mem: Any, out: Any) -> None:
    """Air drag torque τ = −d |q̇| q̇ on an axis with the rate q̇ (rad/s), d in N·m·s²/rad²."""
    i = int(par[AXIS])
    out[i] -= par[A] * abs(s[R_DOT + i]) * s[R_DOT + i]


EFFECTS = (
    Effect(
        name="friction.coulomb",
        summary="Dry friction: −τ_c sgn(q̇), and at rest up to ±τ_c.",
        parameters=(Parameter("torque_Nm", "N·m", 0.0, -0.1, 1.0, 0.02, "τ_c"),),
        hooks={Stage.DRY: coulomb_dry, Stage.TORQUE: coulomb_torque},
        axes=AXES,
        confused_with=("friction.viscous", "encoder.backlash"),
        separated_by="multisine",
        identifiable="reversals at several speeds; a joint that comes to rest shows it best",
        evidence="{axis}_rate",
    ),
    Effect(
        name="friction.viscous",
        summary="Friction proportional to the rate: −c q̇.",
        parameters=(Parameter("damping_Nms_per_rad", "N·m·s/rad", 0.0, -0.5, 5.0, 0.05, "c"),),
        hooks={Stage.TORQUE: viscous},
        axes=AXES,
        confused_with=("friction.coulomb", "drag.quadratic", "aero.inflow"),
        separated_by="multisine",
        identifiable="several speeds on the axis",
        evidence="{axis}_rate",
    ),
    Effect(
        name="drag.quadratic",
        summary="Air drag growing with the square of the rate: −d |q̇| q̇.",
        parameters=(Parameter("drag_Nms2_per_rad2", "N·m·s²/rad²", 0.0, -2.0, 10.0, 0.1, "d"),),
        hooks={Stage.TORQUE: quadratic_drag},
        axes=AXES,
        confused_with=("friction.viscous",),
        separated_by="large",
        identifiable="several speeds on the axis, well apart",
        evidence="{axis}_rate",
    ),
)
