"""Dry (Coulomb) friction: τ = −τ_c sgn(q̇); in a joint at rest, up to ±τ_c against the motion.

Set-valued, without smoothing: a joint that sticks does not creep.
`heli3dof.model.physics.dry_friction` has the step and the effect on an uncertain rate.

Where an algorithm evaluates accelerations without a step (the effect of a small friction along a
known path), the torque is −τ_c tanh(q̇/ω_s), ω_s = 0.002 rad/s + 4 ms · |τ_c|/J. This keeps its
decay rate, τ_c/(J ω_s), below 250 1/s.
"""

from __future__ import annotations

import math
from typing import Any

from heli3dof.axes import AXES
from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import AXIS, J_R, R_DOT, STEPPED, A, Stage

NARROWEST = 0.002
"""rad/s, the part of ω_s that does not grow with friction."""
REVERSAL_S = 0.004
"""s, the time constant of a reversal in the smoothed torque."""


def dry(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[int(par[AXIS])] += par[A]


def torque(s: Any, par: Any, mem: Any, out: Any) -> None:
    if s[STEPPED] < 0.5:
        i = int(par[AXIS])
        width = NARROWEST + REVERSAL_S * abs(par[A]) / s[J_R + i]
        out[i] -= par[A] * math.tanh(s[R_DOT + i] / width)


EFFECT = Effect(
    name="friction.coulomb",
    summary="Dry friction: −τ_c sgn(q̇), and at rest up to ±τ_c.",
    parameters=(Parameter("torque_Nm", "N·m", 0.0, -0.1, 1.0, 0.02, "τ_c"),),
    hooks={Stage.DRY: dry, Stage.TORQUE: torque},
    axes=AXES,
    confused_with=("friction.viscous", "encoder.backlash"),
    separated_by="multisine",
    identifiable="reversals at several speeds; a joint that comes to rest shows it best",
    evidence="{axis}_rate",
)
