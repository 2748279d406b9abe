"""The count per revolution is wrong: reading = rest + k (angle − rest).

Nearly the same as other inertias and stiffness; only the sines and cosines tell. Beware of its
score: it stretches the variance of what is read as well, which the tangents of the innovations
leave out, so both its score and its fit are biased. Counts against the profile are the way to
find it.
"""

from __future__ import annotations

from typing import Any

from heli3dof.axes import AXES
from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import AXIS, REST, A, Stage


def measure(s: Any, par: Any, mem: Any, out: Any) -> None:
    i = int(par[AXIS])
    out[i] = s[REST + i] + par[A] * (out[i] - s[REST + i])


EFFECT = Effect(
    name="encoder.scale",
    summary="The count per revolution is wrong: reading = rest + k (angle − rest).",
    parameters=(Parameter("scale", "–", 1.0, 0.4, 2.5, 0.05, "k", prior_std=0.3),),
    hooks={Stage.MEASURE: measure},
    axes=AXES,
    order=1,
    confused_with=("inertia",),
    separated_by="large",
    identifiable="large angles: only the sines and cosines tell it from an inertia",
    evidence="{axis}",
)
