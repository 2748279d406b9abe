"""Backlash between an axis and its encoder, of full width w (the parameter, in degrees).

At the angle q the encoder reads q − w/2 while the angle rises and q + w/2 while it falls. After a
reversal the encoder keeps its reading e until q has moved by w: e ← min(q + w/2, max(q − w/2, e)).

A simulation keeps e in the effect's memory ``mem``. A filter needs no memory: when the reading
changes, the direction of the change shows whether it is q − w/2 or q + w/2. While the reading is
constant, the angle may lie in an interval that is wider by w than without backlash.
"""

from __future__ import annotations

import math
from typing import Any

from heli3dof.axes import AXES
from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import AXIS, FLANK, A, Stage


def measure(s: Any, par: Any, mem: Any, out: Any) -> None:
    i = int(par[AXIS])
    half = 0.5 * par[A] * math.pi / 180.0
    if s[FLANK + i] > 1.5:
        if mem[0] == 0.0:
            mem[0], mem[1] = 1.0, out[i]
        mem[1] = min(out[i] + half, max(out[i] - half, mem[1]))
        out[i] = mem[1]
    else:
        out[i] -= half * s[FLANK + i]


EFFECT = Effect(
    name="encoder.backlash",
    summary="Backlash between the axis and its encoder.",
    parameters=(Parameter("angle_deg", "°", 0.0, -0.5, 10.0, 0.3, "full width of the backlash"),),
    hooks={Stage.MEASURE: measure},
    axes=AXES,
    starts=(0.05, 0.09, 0.16, 0.28, 0.5, 0.9, 1.6, 2.8, 5.0),
    confused_with=("friction.coulomb", "motor.delay"),
    separated_by="large",
    identifiable="reversals of the axis, slow and quick",
    evidence="{axis}_rate",
)
