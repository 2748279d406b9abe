"""The count per revolution is wrong: reading = rest + k (angle − rest).

``rest`` is the angle at which the encoder's count is zero. Instead of k, other inertias and
stiffnesses fit nearly as well; only sines and cosines of the angle distinguish them from k. k also
scales the variance of the readings. A fit and a score test ignore this, so their results for k are
biased. Instead of fitting k, compare the encoder's data sheet with the counts per revolution in the
profile.
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
    identifiable="large angles: only sines and cosines distinguish it from an inertia",
    evidence="{axis}",
    candidate=False,  # its score is biased, and the rigid body's inertias explain most of it
)
