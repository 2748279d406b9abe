"""The rig in three dimensions: its frames, their poses at each sample, and the parts to draw.

Frames are right-handed, in m. With roll r, pitch p, yaw ψ (rad) and rotations R about an axis:

    base   on the table, at the foot of the post; z up
    arm    origin (0, 0, h) in base, rotation R_z(ψ) R_y(−r); the arm is its x axis
    body   origin (L_a, 0, 0) in arm, rotation R_x(p); the front motor is at +L_h on its y axis,
           the thrusts act along its z axis

L_a: distance from the yaw axis to the body; L_h: distance from the pitch axis to a motor; h: height
of the arm's pivot, such that the body at the rest angle is just above the table.

So positive roll moves the body up, positive pitch the front motor up, and positive yaw the arm
counter-clockwise seen from above. A positive pitch accelerates yaw in the negative direction, as
the yaw torque Q_ψ of `heli3dof.model.physics.rigid_body` demands. Quaternions are (x, y, z, w).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from heli3dof.arrays import FloatArray, IndexArray
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import Profile

BASE, ARM, BODY = "base", "arm", "body"
FRAMES_PER_S = 60.0
"""1/s, largest number of poses per second of flight: the refresh rate of a usual screen"""
THICKNESS = 0.04
"""Thickness of arm and body as a share of L_a; it affects the picture only"""

Colour = tuple[float, float, float]
GREY: Colour = (0.45, 0.48, 0.51)
VERMILION: Colour = (0.835, 0.369, 0.0)
BLUE: Colour = (0.0, 0.447, 0.698)


@dataclass(frozen=True)
class Part:
    """A box or an upright cylinder to draw; ``centre`` and ``size`` (m) in its ``frame``."""

    name: str
    frame: str
    form: Literal["box", "cylinder"]
    centre: tuple[float, float, float]
    size: tuple[float, float, float]
    """m, lengths along x, y, z; for a cylinder: diameter, diameter, height."""
    colour: Colour


@dataclass(frozen=True, eq=False)
class Poses:
    """Poses of the frames arm and body at n samples of a recording."""

    rows: IndexArray
    """(n,) indices of the recording's rows."""
    arm: FloatArray
    """(n, 4) quaternions (x, y, z, w) of the frame arm in the frame base."""
    body: FloatArray
    """(n, 4) quaternions (x, y, z, w) of the frame body in the frame arm."""
    arm_origin: tuple[float, float, float]
    """m, origin of the frame arm in the frame base."""
    body_origin: tuple[float, float, float]
    """m, origin of the frame body in the frame arm."""


def poses(recording: Recording) -> Poses:
    """Return the poses of arm and body in a recording, at most `FRAMES_PER_S` per second.

    An axis that was not measured is drawn at zero. Rows in which the angle of a measured axis is
    missing have no pose.
    """
    angle = np.where(np.isnan(recording.angle).all(axis=0), 0.0, recording.angle)
    complete = np.flatnonzero(np.isfinite(angle).all(axis=1))
    slot = np.floor((recording.t[complete] - recording.t[0]) * FRAMES_PER_S + 1e-6)
    rows = complete[np.unique(slot, return_index=True)[1]]
    profile = recording.profile
    (c_r, c_p, c_y), (s_r, s_p, s_y) = np.cos(angle[rows].T / 2), np.sin(angle[rows].T / 2)
    zero = np.zeros_like(c_p)
    return Poses(
        rows,
        np.column_stack([s_y * s_r, -c_y * s_r, s_y * c_r, c_y * c_r]),  # R_z(ψ) R_y(−r)
        np.column_stack([s_p, zero, zero, c_p]),  # R_x(p)
        (0.0, 0.0, pivot_height(profile)),
        (profile.geometry.L_a, 0.0, 0.0),
    )


def pivot_height(profile: Profile) -> float:
    """Return the height of the arm's pivot over the table in m."""
    L_a = profile.geometry.L_a
    return float(L_a * np.sin(abs(np.radians(profile.encoder.roll_rest_deg))) + THICKNESS * L_a)


def parts(profile: Profile) -> list[Part]:
    """Return the parts of a rig: base, arm with counterweight, body, front and back rotor."""
    g, h = profile.geometry, pivot_height(profile)
    thick = THICKNESS * g.L_a
    weight, rotor = 4 * thick, 1.6 * g.L_h
    length = g.L_a + g.L_w
    return [
        Part("base", BASE, "cylinder", (0, 0, h / 2), (thick, thick, h), GREY),
        Part("arm", ARM, "box", ((g.L_a - g.L_w) / 2, 0, 0), (length, thick, thick), GREY),
        Part("counterweight", ARM, "box", (-g.L_w, 0, 0), (weight, weight, weight), GREY),
        Part("body", BODY, "box", (0, 0, 0), (thick, 2 * g.L_h, thick), GREY),
        *(
            Part(f"{motor} rotor", BODY, "cylinder", (0, y, thick), (rotor, rotor, thick / 4), hue)
            for motor, y, hue in (("front", g.L_h, VERMILION), ("back", -g.L_h, BLUE))
        ),
    ]
