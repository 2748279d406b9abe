"""The switch for ``--base hover``: the paper's linear hover model replaces the rigid body.

s[LINEAR] = 1 in the simulation's parameter array s selects the first-order equations about level
hover (`heli3dof.model.physics.rigid_body`). Other effects act as on the rigid body. The effect
`geometry` then tests whether the recordings need the rigid body instead.
"""

from __future__ import annotations

from typing import Any

from heli3dof.model.effects.base import Effect
from heli3dof.model.physics.state_layout import LINEAR, Stage


def setup(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[LINEAR] = 1.0


EFFECT = Effect(
    name="base.hover",
    summary="The base is the paper's hover model, linear about level hover; a switch, no finding.",
    parameters=(),
    hooks={Stage.SETUP: setup},
    separated_by="large",
    identifiable="chosen by --base hover, not estimated",
    evidence="roll",
)
