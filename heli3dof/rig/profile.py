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

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from heli3dof.errors import ProfileError, did_you_mean

Positive = Annotated[float, Field(strict=True, gt=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Counts = Annotated[int, Field(strict=True)]

K_G: tuple[tuple[float, ...], ...] = (
    (37.6, 13.2, -11.5, 20.9, 4.7, -16.1, 10.0, -1.0),
    (37.6, -13.2, 11.5, 20.9, -4.7, 16.1, 10.0, 1.0),
)
"""Eq (14) as printed: V/rad (×3), V·s/rad (×3), V/(rad·s) (×2); rows front, back (E7)."""


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Geometry(_Section):
    """Arm lengths in metres."""

    L_w: Positive
    L_a: Positive
    L_h: Positive


class Mass(_Section):
    """Point masses in kilograms."""

    m_w: Positive
    m_f: Positive
    m_b: Positive


class Motor(_Section):
    """Thrust per volt (N/V), hover voltage per motor (V), amplifier limit (V)."""

    K_f: Positive
    V_o: Finite
    v_max: Positive


class Encoder(_Section):
    """Counts per revolution after ×4; negative where the count falls as the angle rises."""

    roll: Counts
    pitch: Counts
    yaw: Counts

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


class Loop(_Section):
    """The control rate in Hz."""

    rate_hz: Positive


class Limits(_Section):
    """The safety envelope. Defaults suit the laboratory rig of the paper.

    Angles are absolute readings; a trip outside them ramps the motors to zero. ``roll_min_deg``
    lies below the table (−27.5°), so that a start from rest is inside.
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


class ControllerSpec(_Section):
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


class Profile(_Section):
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
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ProfileError(
            f"There is no profile {path}.",
            cause="a typing error in the path, or another working directory.",
            fix=f"ls {path.parent}",
        ) from None
    except (OSError, UnicodeDecodeError) as error:
        raise ProfileError(f"The profile {path} cannot be read: {error}.") from error
    except tomllib.TOMLDecodeError as error:
        raise ProfileError(
            f"The profile {path} is not valid TOML: {error}.",
            cause="a missing quote, bracket or equals sign.",
            fix=f"edit {path}",
        ) from error
    return profile_from_dict(data, source=str(path))


def profile_from_dict(data: Mapping[str, Any], *, source: str = "profile") -> Profile:
    """Check a nested mapping (as TOML gives it) and build the profile."""
    try:
        return Profile.model_validate(data, strict=False)
    except ValidationError as error:
        raise _explain(error, source) from None


def _explain(error: ValidationError, source: str) -> ProfileError:
    # A misspelt key is both unknown and missing: the unknown one tells more.
    errors = error.errors(include_url=False)
    first = min(errors, key=lambda e: e["type"] != "extra_forbidden")
    path = [str(part) for part in first["loc"]]
    key = ".".join(path)
    section, known = _known_keys(path[:-1])
    where = f"in [{section}]" if section else "at the top level"
    if first["type"] == "extra_forbidden":
        return ProfileError(
            f"{source}: unknown key {key!r}.",
            cause=f"a typing error; {did_you_mean(path[-1], known)}",
            fix=f"edit {source}; keys {where}: {', '.join(known)}",
        )
    if first["type"] == "missing":
        return ProfileError(
            f"{source}: the key {key!r} is missing.",
            cause="the profile was cut short or written for another version.",
            fix=f"add it to {source}; keys {where}: {', '.join(known)}",
        )
    return ProfileError(
        f"{source}: {key} = {first['input']!r} cannot be: {first['msg']}.",
        cause="a wrong unit or sign, or text where a number belongs.",
        fix=f"edit {source}",
    )


def _known_keys(path: list[str]) -> tuple[str, list[str]]:
    model: type[BaseModel] = Profile
    names: list[str] = []
    for part in path:
        field = model.model_fields.get(part)
        if field is None:
            break
        options = [field.annotation, *getattr(field.annotation, "__args__", ())]
        inner = [o for o in options if isinstance(o, type) and issubclass(o, BaseModel)]
        if not inner:
            break
        model = inner[0]
        names.append(part)
    return ".".join(names), list(model.model_fields)


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
