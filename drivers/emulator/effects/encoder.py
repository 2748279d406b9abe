"""Encoder errors; they act on the angles before these are rounded to counts.

- Backlash of full width w between the axis and its encoder: the encoder moves only while one of the
  two flanks is in contact.
- Offset: reading = angle + offset, because the counts were zeroed at a wrong angle. The emulated
  rig's initial angles, and the roll angle at which the arm lies on the table, are specified as
  readings. So the simulated true angles are these angles minus the offset.
- Scale: reading = rest + k (angle − rest), because the encoder's number of lines is wrong. k is the
  scale, rest the angle at which the counts are zero.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..body import Setup
from ..plant_effects import Row, kernel
from ..plant_layout import AXIS, REST, A, Stage
from .base import ALL_AXES, Effect, Parameter

RAD_PER_DEG = np.pi / 180
ROLL = 0


@kernel
def backlash(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    axis = int(par[AXIS])
    half = 0.5 * par[A] * RAD_PER_DEG
    if mem[0] == 0.0:
        mem[0], mem[1] = 1.0, out[axis]
    mem[1] = min(out[axis] + half, max(out[axis] - half, mem[1]))
    out[axis] = mem[1]


@kernel
def scale(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    axis = int(par[AXIS])
    rest = body[REST + axis]
    out[axis] = rest + par[A] * (out[axis] - rest)


@kernel
def offset(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    out[int(par[AXIS])] += par[A] * RAD_PER_DEG


def _scale(setup: Setup, axis: int, values: tuple[float, ...]) -> Setup:
    start, rest = list(setup.start), setup.rest[axis]
    start[axis] = rest + (start[axis] - rest) / values[0]
    return replace(setup, start=(start[0], start[1], start[2]))


def _offset(setup: Setup, axis: int, values: tuple[float, ...]) -> Setup:
    shift = values[0] * RAD_PER_DEG
    start, low = list(setup.start), list(setup.low)
    start[axis] -= shift
    if axis == ROLL:  # roll was zeroed on the table
        low[axis] -= shift
    return replace(setup, start=(start[0], start[1], start[2]), low=(low[0], low[1], low[2]))


EFFECTS = (
    Effect(
        name="encoder.backlash",
        summary="Backlash between the axis and its encoder.",
        parameters=(Parameter("angle_deg", "°", 0.0, 10.0, "full width"),),
        example="encoder.backlash.pitch:0.5",
        axes=ALL_AXES,
        kernels={Stage.MEASURE: backlash},
        order=1,
    ),
    Effect(
        name="encoder.offset",
        summary="The zero was set at the wrong angle: reading = angle + offset.",
        parameters=(Parameter("angle_deg", "°", -20.0, 20.0, "the offset"),),
        example="encoder.offset.pitch:2.0",
        axes=ALL_AXES,
        kernels={Stage.MEASURE: offset},
        setup=_offset,
        order=2,
    ),
    Effect(
        name="encoder.scale",
        summary="Wrong counts per revolution: reading = rest + k (angle − rest).",
        parameters=(Parameter("scale", "–", 0.5, 2.0, "k"),),
        example="encoder.scale.roll:1.05",
        axes=ALL_AXES,
        kernels={Stage.MEASURE: scale},
        setup=_scale,
        order=3,
    ),
)
