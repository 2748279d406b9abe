"""A rig's profile: the numbers of Table I and of its loop, read from TOML and checked.

The keys are the contract's. Masses, lengths and gains carry the paper's symbols; what people
type as angles is in degrees and says so in its name. ``Profile.controller`` is None where the
file has no ``[controller]``: on an imported log that means *the loop is unknown*.

=========  =======================  ==========================================================
symbol     key                      unit
=========  =======================  ==========================================================
L_w        geometry.L_w             m, yaw axis to counterweight (E1: Table I swaps 14 and 15)
L_a        geometry.L_a             m, yaw axis to helicopter body
L_h        geometry.L_h             m, pitch axis to each motor
m_w        mass.m_w                 kg, counterweight
m_f, m_b   mass.m_f, mass.m_b       kg, front and back motor
K_f        motor.K_f                N/V, thrust per volt
V_o        motor.V_o                V per motor at hover (E2: calibrate it, never derive its sign)
v_max      motor.v_max              V, amplifier limit
=========  =======================  ==========================================================
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, field_validator

from heli3dof.errors import ProfileError
from heli3dof.toml_file import Finite, Positive, Section, check, read_toml

Counts = Annotated[int, Field(strict=True)]

K_G: tuple[tuple[float, ...], ...] = (
    (37.6, 13.2, -11.5, 20.9, 4.7, -16.1, 10.0, -1.0),
    (37.6, -13.2, 11.5, 20.9, -4.7, 16.1, 10.0, 1.0),
)
"""Eq (14) as printed: V/rad (×3), V·s/rad (×3), V/(rad·s) (×2); rows front, back (E7)."""


class Geometry(Section):
    """Arm lengths in metres."""

    L_w: Positive
    L_a: Positive
    L_h: Positive


class Mass(Section):
    """Point masses in kilograms."""

    m_w: Positive
    m_f: Positive
    m_b: Positive


class Motor(Section):
    """Thrust per volt (N/V), hover voltage per motor (V), amplifier limit (V)."""

    K_f: Positive
    V_o: Finite
    v_max: Positive


class Encoder(Section):
    """Counts per revolution after ×4; negative where the count falls as the angle rises.

    Counts are zero at power-up, with the rig at its rest angles: on the table, −27.5° in roll.
    """

    roll: Counts
    pitch: Counts
    yaw: Counts
    roll_rest_deg: Finite = -27.5
    pitch_rest_deg: Finite = 0.0
    yaw_rest_deg: Finite = 0.0

    @field_validator("roll", "pitch", "yaw")
    @classmethod
    def _not_zero(cls, value: int) -> int:
        if value == 0:
            raise ValueError("must not be zero")
        return value

    @property
    def rad_per_count(self) -> np.ndarray:
        """(3,) rad per count, signed."""
        return 2 * np.pi / np.array([self.roll, self.pitch, self.yaw], dtype=float)

    @property
    def rest_rad(self) -> np.ndarray:
        """(3,) rad: the angles at which the counts are zero."""
        return np.radians([self.roll_rest_deg, self.pitch_rest_deg, self.yaw_rest_deg])


class Loop(Section):
    """The control rate in Hz."""

    rate_hz: Positive


class Limits(Section):
    """The safety envelope. Defaults suit the laboratory rig of the paper.

    Angles are absolute readings; a trip outside them ramps the motors to zero. ``roll_min_deg``
    lies below the table (−27.5°), so that a start from rest is inside. The motors are ramped to
    zero over ``ramp_down_s`` after a trip or an interrupt, over ``landing_s`` at a plan's end.
    What the last four mean stands in ``heli3dof.experiment.watches``.
    """

    roll_min_deg: Finite = -32.0
    roll_max_deg: Finite = 34.0
    pitch_max_deg: Positive = 60.0
    yaw_max_deg: Positive = 720.0
    roll_rate_max_deg_per_s: Positive = 150.0
    pitch_rate_max_deg_per_s: Positive = 400.0
    yaw_rate_max_deg_per_s: Positive = 200.0
    slew_max_V_per_s: Positive = 5000.0
    duration_max_s: Positive = 600.0
    ramp_down_s: Positive = 0.5
    landing_s: Positive = 3.0
    late_max_s: Positive = 0.01
    late_max_share: Positive = 0.5
    lost_max_s: Positive = 0.05
    saturated_max_s: Positive = 2.0


class ControllerSpec(Section):
    """Gains and filters of the contract's default controller; see ``heli3dof.model.controller``.

    ``K`` is 2 × 8, rows front and back, columns V per (r, p, ψ error; ṙ, ṗ, ψ̇; ∫r, ∫ψ error),
    radians and seconds.
    """

    K: tuple[tuple[Finite, ...], tuple[Finite, ...]] = Field(default=(K_G[0], K_G[1]))
    reference_rate_limit_deg_per_s: Positive = 45.0
    integrator_clamp_V: Positive = 7.5
    derivative_cutoff_hz: Positive = 20.0
    derivative_damping: Positive = 0.9

    @field_validator("K")
    @classmethod
    def _two_by_eight(cls, value: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
        if any(len(row) != 8 for row in value):
            raise ValueError("K is 2 rows of 8 gains: r p ψ ṙ ṗ ψ̇ ∫r ∫ψ")
        return value

    @property
    def K_g(self) -> np.ndarray:
        """(2, 8) gain matrix."""
        return np.array(self.K, dtype=float)


class Profile(Section):
    """Everything about a rig that is known before a flight."""

    name: str = "unnamed"
    geometry: Geometry
    mass: Mass
    motor: Motor
    encoder: Encoder
    loop: Loop
    limits: Limits = Limits()
    controller: ControllerSpec | None = None
    tolerance: Positive = 0.15

    @property
    def dt(self) -> float:
        """Control period in seconds."""
        return 1.0 / self.loop.rate_hz

    @property
    def loop_is_known(self) -> bool:
        """True when the recording's controller is known, so that the loop may be replayed."""
        return self.controller is not None

    def with_controller(self) -> Profile:
        """This profile, with the default controller where none was given (for flights)."""
        if self.controller is not None:
            return self
        return self.model_copy(update={"controller": ControllerSpec()})

    def to_dict(self) -> dict[str, Any]:
        """Plain nested dict, as the TOML file would hold it (None dropped)."""
        return self.model_dump(mode="json", exclude_none=True)


def load_profile(path: str | Path) -> Profile:
    """Read a profile from a TOML file.

    Raises ProfileError naming the key, the file and the nearest known key.
    """
    path = Path(path)
    return profile_from_dict(read_toml(path, "profile", ProfileError), source=str(path))


def profile_from_dict(data: Mapping[str, Any], *, source: str = "profile") -> Profile:
    """Check a nested mapping (as TOML gives it) and build the profile."""
    return check(Profile, data, source, ProfileError)


TABLE_I: Mapping[str, Any] = {
    "name": "table-1",
    "geometry": {"L_w": 0.4699, "L_a": 0.6604, "L_h": 0.1778},
    "mass": {"m_w": 1.87, "m_f": 0.575, "m_b": 0.575},
    "motor": {"K_f": 0.1188, "V_o": 7.456, "v_max": 24.0},
    "encoder": {"roll": 4096, "pitch": 4096, "yaw": 8192},
    "loop": {"rate_hz": 500.0},
    "controller": {},
}
"""The paper's rig (Table I, erratum E1 mended), flown at 500 Hz with the default controller."""


def default_profile() -> Profile:
    """The paper's rig: the profile used when none is given."""
    return profile_from_dict(TABLE_I, source="the built-in profile")
