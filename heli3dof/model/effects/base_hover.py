"""The base is the paper's linear hover model, not the rigid body: s[LINEAR] = 1.

Its equations stand in `heli3dof.model.physics.rigid_body`: what is of first order about level
hover. A switch for ``--base hover``, with no parameters and no cause of anything; other effects
stay as they are, and `geometry` says how much of the rigid body the recordings ask back.
"""

from __future__ import annotations

from typing import Any

from heli3dof.model.effects.base import Effect
from heli3dof.model.physics.state_layout import LINEAR, Stage


def setup(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[LINEAR] = 1.0


EFFECT = Effect(
    name="base.hover",
    summary="The base is the paper's hover model, linear about level hover; a switch, no cause.",
    parameters=(),
    hooks={Stage.SETUP: setup},
    separated_by="large",
    identifiable="chosen by --base hover, not estimated",
    evidence="roll",
)
