"""Effects on what the encoders read."""

from __future__ import annotations

import math
from typing import Any

from heli3dof.axes import AXES
from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import AXIS, FLANK, REST, A, Stage


def backlash(s: Any, par: Any, mem: Any, out: Any) -> None:
    """Backlash between an axis and its encoder, of full width w (the parameter, in degrees).

    At the angle q the encoder reads q − w/2 while the angle rises and q + w/2 while it falls. After
    a reversal the encoder keeps its reading e until q has moved by w: e ← min(q + w/2, max(q − w/2,
    e)).

    A simulation keeps e in the effect's memory ``mem``. A filter needs no memory: when the reading
    changes, the direction of the change shows whether the reading is q − w/2 or q + w/2. While the
    reading is constant, the angle may lie in an interval that is wider by w than without backlash.
    """
    i = int(par[AXIS])
    half = 0.5 * par[A] * math.pi / 180.0
    if s[FLANK + i] > 1.5:
        if mem[0] == 0.0:
            mem[0], mem[1] = 1.0, out[i]
        mem[1] = min(out[i] + half, max(out[i] - half, mem[1]))
        out[i] = mem[1]
    else:
        out[i] -= half * s[FLANK + i]


def offset(s: Any, par: Any, mem: Any, out: Any) -> None:
    """The encoder's zero was set at the wrong angle: reading = angle + offset.

    On roll, an offset has the same effect as other values of the gravity and pendulum torques. On
    pitch, a reading of zero means a true pitch angle of −offset. The thrust is then tilted and
    causes a torque on yaw that is proportional to the offset.
    """
    out[int(par[AXIS])] += par[A] * math.pi / 180.0


def scale(s: Any, par: Any, mem: Any, out: Any) -> None:
    """The count per revolution is wrong: reading = rest + k (angle − rest).

    ``rest`` is the angle at which the encoder's count is zero. Other inertias and stiffnesses
    fit the data nearly as well as k; only sines and cosines of the angle distinguish them from k. k
    also scales the variance of the readings. A fit and a score test ignore this, so their results
    for k are biased. Instead of fitting k, compare the encoder's data sheet with the counts per
    revolution in the profile.
    """
    i = int(par[AXIS])
    out[i] = s[REST + i] + par[A] * (out[i] - s[REST + i])


EFFECTS = (
    Effect(
        name="encoder.backlash",
        summary="Backlash between the axis and its encoder.",
        parameters=(
            Parameter("angle_deg", "°", 0.0, -0.5, 10.0, 0.3, "full width of the backlash"),
        ),
        hooks={Stage.MEASURE: backlash},
        axes=AXES,
        starts=(0.05, 0.09, 0.16, 0.28, 0.5, 0.9, 1.6, 2.8, 5.0),
        confused_with=("friction.coulomb", "motor.delay"),
        separated_by="large",
        identifiable="reversals of the axis, slow and quick",
        evidence="{axis}_rate",
    ),
    Effect(
        name="encoder.offset",
        summary="The zero was set at the wrong angle: reading = angle + offset.",
        parameters=(
            Parameter("angle_deg", "°", 0.0, -20.0, 20.0, 1.0, "the offset", prior_std=3.0),
        ),
        hooks={Stage.MEASURE: offset},
        axes=AXES,
        order=2,
        confused_with=("bias.torque", "mass.imbalance"),
        separated_by="large",
        identifiable="large pitch or roll angles with the thrust varied",
        evidence="voltage_sum",
    ),
    Effect(
        name="encoder.scale",
        summary="The count per revolution is wrong: reading = rest + k (angle − rest).",
        parameters=(Parameter("scale", "–", 1.0, 0.4, 2.5, 0.05, "k", prior_std=0.3),),
        hooks={Stage.MEASURE: scale},
        axes=AXES,
        order=1,
        confused_with=("inertia",),
        separated_by="large",
        identifiable="large angles: only sines and cosines distinguish it from an inertia",
        evidence="{axis}",
        candidate=False,  # the score is biased, and changed inertias explain most of the effect
    ),
)
