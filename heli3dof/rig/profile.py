"""A rig's profile: the parameters of the paper's Table I and of the control loop, read from TOML.

The keys are the paper's symbols. The `heli3dof.toml_file.Key` of each key gives its unit,
its range and how to measure it. ``Profile.controller`` is None if the file has no ``[controller]``;
the controller of an imported log is then unknown. The models use these quantities, computed from
the keys::

    T_g     = 2 L_a K_f V_o                            gravity's torque on the level arm, N·m
    J_roll  = m_w L_w² + (m_f + m_b) L_a²              kg·m², unless ``[inertia]`` gives it
    J_pitch = (m_f + m_b) L_h²
    J_yaw   = J_roll + J_pitch

L_a, L_w: yaw axis to body and to counterweight (m); L_h: pitch axis to motor (m); K_f: thrust per
volt (N/V); V_o: hover voltage (V); m_w, m_f, m_b: masses of counterweight, front and back motor
(kg).

Table I swaps the rows 14 and 15, L_w and L_a (erratum E1). Table I's masses give V_o the wrong
sign (E2), so V_o has its own key. With three point masses, J_yaw is always J_roll + J_pitch.
Measured inertias need not satisfy this, so they have their own section ``[inertia]``.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, ValidationInfo, field_validator, model_validator
from pydantic_core import PydanticCustomError

from heli3dof.arrays import FloatArray
from heli3dof.errors import ProfileError
from heli3dof.rig.log_columns import LogColumns
from heli3dof.toml_file import (
    Finite,
    Key,
    Positive,
    Range,
    Section,
    check,
    is_recorded,
    read_toml,
)

Counts = Annotated[int, Field(strict=True)]

K_G: tuple[tuple[float, ...], ...] = (
    (37.6, 13.2, -11.5, 20.9, 4.7, -16.1, 10.0, -1.0),
    (37.6, -13.2, 11.5, 20.9, -4.7, 16.1, 10.0, 1.0),
)
"""Controller gain (2, 8) of the paper's eq (14), as printed (erratum E7). Rows: front, back motor.
Units of the columns: V/rad (the first 3), V·s/rad (the next 3), V/(rad·s) (the last 2)."""

g = 9.81
"""m/s², the value with which Table I gives |V_o| = 7.456 V."""

RULE = "tape measure, between the axes"
SCALE = "kitchen scale"


class Geometry(Section):
    """Distances of counterweight, body and motors from their axes, in metres."""

    L_w: Annotated[
        Positive,
        Key("yaw axis to the counterweight's centre", "m", RULE, "0.47", (0.15, 1.2), (0.03, 3.0)),
    ]
    L_a: Annotated[
        Positive,
        Key("yaw axis to the body's pitch axis", "m", RULE, "0.66", (0.2, 1.2), (0.05, 3.0)),
    ]
    L_h: Annotated[
        Positive,
        Key(
            "pitch axis to a motor's shaft",
            "m", "tape measure, from shaft to shaft, halved", "0.178", (0.05, 0.5), (0.01, 1.0),
        ),
    ]  # fmt: skip


def _motor_mass(end: str) -> Key:
    meaning = f"{end} motor with propeller, guard and half of the body"
    measure = f"{SCALE}; or half of the body's weight"
    return Key(meaning, "kg", measure, "0.575", (0.1, 2.0), (0.005, 20.0))


class Mass(Section):
    """Masses of the counterweight, the front motor and the back motor, in kilograms."""

    m_w: Annotated[
        Positive,
        Key("counterweight", "kg", f"{SCALE}, taken off the arm", "1.87", (0.3, 6.0), (0.01, 50.0)),
    ]
    m_f: Annotated[Positive, _motor_mass("front")]
    m_b: Annotated[Positive, _motor_mass("back")]


class Motor(Section):
    """The motors: thrust per volt (N/V), voltage of each at level hover (V), voltage limit (V)."""

    K_f: Annotated[
        Positive,
        Key(
            "thrust of one motor per volt", "N/V",
            "kitchen scale under the body: its reading falls by ΔW kg when both motors get V "
            "volts; K_f = 9.81 ΔW / (2 V)", "0.119", (0.03, 0.5), (0.001, 20.0),
        ),
    ]  # fmt: skip
    V_o: Annotated[
        Finite,
        Key(
            "voltage of each motor at level hover; negative if the arm rests with the body up", "V",
            "raise both voltages until the body lifts off the table; V_o = V / cos(rest angle); or "
            "the mean voltage of a flight's level part; or from the masses", "7.456",
            (0.5, 20.0), (0.0, 200.0),
        ),
    ]  # fmt: skip
    v_max: Annotated[
        Positive,
        Key(
            "the amplifier's voltage limit, either sign", "V",
            "the amplifier's data sheet; a board of ±10 V and a gain of 1 give 10", "24",
            (5.0, 60.0), (0.5, 400.0),
        ),
    ]  # fmt: skip

    @model_validator(mode="after")
    def _within_the_amplifier(self, info: ValidationInfo) -> Motor:
        if abs(self.V_o) >= self.v_max and not is_recorded(info):
            raise PydanticCustomError(
                "conflict",
                "motor.V_o = {V_o} V is not below motor.v_max = {v_max} V: the rig cannot hover",
                {"V_o": f"{self.V_o:g}", "v_max": f"{self.v_max:g}",
                 "slip": "V_o is per motor, not the sum of both; or K_f is too small."},
            )  # fmt: skip
        return self

    @property
    def hover_V(self) -> float:
        """Return max(|V_o|, v_max/8) in V: the size of the hover voltage, but never zero.

        V_o: hover voltage, which is 0 for a balanced arm; v_max: the amplifier's limit.
        """
        return max(abs(self.V_o), self.v_max / 8)


def _moment(axis: str, typical: str, usual: Range, plausible: Range) -> Key:
    measure = "heli3dof profile update, from a diagnosis"
    return Key(f"about the {axis} axis", "kg·m²", measure, typical, usual, plausible)


class Inertia(Section):
    """Measured inertias of the level rig in kg·m²; None: computed from the masses."""

    roll: Annotated[
        Positive | None, _moment("roll (elevation)", "0.91", (0.02, 5.0), (1e-4, 100.0))
    ] = None
    pitch: Annotated[
        Positive | None, _moment("pitch (tilt)", "0.036", (0.001, 0.5), (1e-6, 10.0))
    ] = None
    yaw: Annotated[Positive | None, _moment("yaw (travel)", "0.95", (0.02, 5.0), (1e-4, 100.0))] = (
        None
    )


REST = "digital level or protractor on the resting rig"


def _encoder(axis: str, positive_motion: str, typical: str) -> Key:
    meaning = f"{axis} encoder; negative if the count falls as {positive_motion}"
    measure = "data sheet (lines × 4); or turn the axis once by hand: heli3dof monitor --json"
    return Key(meaning, "counts/rev", measure, typical, (500, 50000), (0, 1e8))


class Encoder(Section):
    """The encoders: counts per revolution of roll, pitch and yaw, and the angles at rest.

    The counts per revolution are 4 times the encoder's lines, and negative if the count falls as
    the angle rises. Counts are zero at power-up, with the rig at its rest angles. The paper's rig
    rests with its body on the table, at −27.5° in roll.
    """

    roll: Annotated[Counts, _encoder("roll", "the body rises", "4096")]
    pitch: Annotated[Counts, _encoder("pitch", "the front motor rises", "4096")]
    yaw: Annotated[Counts, _encoder("yaw", "the arm turns counter-clockwise from above", "8192")]
    roll_rest_deg: Annotated[
        Finite,
        Key("roll at rest on the table", "°", f"{REST}, along the arm", "-27.5", (5, 50), (0, 90)),
    ] = -27.5
    pitch_rest_deg: Annotated[
        Finite, Key("pitch at rest", "°", f"{REST}, along the body", "0", (0, 30), (0, 90))
    ] = 0.0
    yaw_rest_deg: Annotated[
        Finite, Key("yaw at rest, from wherever yaw is to be zero", "°", "choose 0", "0", (0, 360))
    ] = 0.0

    @field_validator("roll", "pitch", "yaw")
    @classmethod
    def _not_zero(cls, value: int) -> int:
        if value == 0:
            raise ValueError("must not be zero")
        return value

    @property
    def rad_per_count(self) -> FloatArray:
        """Return the angle per count (3,) of roll, pitch and yaw, in rad, signed.

        It is negative if the count falls as the angle rises.
        """
        return 2 * np.pi / np.array([self.roll, self.pitch, self.yaw], dtype=float)

    @property
    def rest_rad(self) -> FloatArray:
        """Return roll, pitch and yaw (3,) at rest in rad, where the encoder counts are zero."""
        return np.radians([self.roll_rest_deg, self.pitch_rest_deg, self.yaw_rest_deg])


class Loop(Section):
    """The control loop's rate in Hz."""

    rate_hz: Annotated[
        Positive,
        Key(
            "control periods per second", "Hz", "choose 500; heli3dof doctor reports whether "
            "this computer keeps up", "500", (100.0, 2000.0), (1.0, 50000.0),
        ),
    ]  # fmt: skip


class Limits(Section):
    """Limits that end a flight (safety envelope); the defaults suit the paper's rig.

    Angles are absolute encoder readings. ``roll_min_deg`` is below the rest angle on the table
    (−27.5°), so that a start from rest is within the limits. The motors are ramped to zero over
    ``ramp_down_s`` after a trip or an interrupt, and over ``landing_s`` at a plan's end. From
    voltages far from the hover voltage, the motors go to zero without a ramp
    (`heli3dof.experiment.control_loop.ramp_down`). ``late_max_s``, ``late_max_share``,
    ``lost_max_s`` and ``saturated_max_s`` are limits of `heli3dof.experiment.safety_monitors`.
    """

    roll_min_deg: Annotated[
        Finite, Key("lowest roll", "°", "a few degrees below the rest angle")
    ] = -32.0
    roll_max_deg: Annotated[
        Finite, Key("highest roll", "°", "a few degrees below the mechanical stop")
    ] = 34.0
    pitch_max_deg: Annotated[
        Positive, Key("largest pitch, either way", "°", "the mechanical stop or more")
    ] = 60.0
    yaw_max_deg: Annotated[
        Positive, Key("largest yaw, either way", "°", "what the cables allow; any with a slip ring")
    ] = 720.0
    roll_rate_max_deg_per_s: Annotated[Positive, Key("fastest roll", "°/s")] = 150.0
    pitch_rate_max_deg_per_s: Annotated[Positive, Key("fastest pitch", "°/s")] = 400.0
    yaw_rate_max_deg_per_s: Annotated[Positive, Key("fastest yaw", "°/s")] = 200.0
    slew_max_V_per_s: Annotated[
        Positive, Key("fastest change of a motor's voltage", "V/s", "the amplifier's data sheet")
    ] = 5000.0
    duration_max_s: Annotated[Positive, Key("longest flight", "s")] = 600.0
    ramp_down_s: Annotated[
        Positive,
        Key(
            "ramp from hover to zero after a trip or an interrupt",
            "s",
            usual=(0.1, 2.0),
            plausible=(0.0, 10.0),
        ),
    ] = 0.5
    landing_s: Annotated[
        Positive,
        Key(
            "ramp from hover to zero at a plan's end",
            "s",
            usual=(0.1, 10.0),
            plausible=(0.0, 60.0),
        ),
    ] = 3.0
    late_max_s: Annotated[
        Positive,
        Key(
            "longer delays of a period count as late",
            "s",
            usual=(0.001, 0.05),
            plausible=(0.0, 1.0),
        ),
    ] = 0.01
    late_max_share: Annotated[
        Positive,
        Key(
            "a larger share of late periods ends the flight",
            "–",
            usual=(0.05, 0.8),
            plausible=(0.0, 1.0),
        ),
    ] = 0.5
    lost_max_s: Annotated[
        Positive,
        Key(
            "longer gaps of encoder readings end the flight",
            "s",
            usual=(0.002, 0.1),
            plausible=(0.0, 1.0),
        ),
    ] = 0.05
    saturated_max_s: Annotated[
        Positive,
        Key(
            "a motor at its limit for longer ends the flight",
            "s",
            usual=(0.1, 10.0),
            plausible=(0.0, 60.0),
        ),
    ] = 2.0

    @model_validator(mode="after")
    def _lowest_below_highest(self, info: ValidationInfo) -> Limits:
        if self.roll_min_deg >= self.roll_max_deg and not is_recorded(info):
            raise PydanticCustomError(
                "conflict",
                "limits.roll_min_deg = {low}° is not below limits.roll_max_deg = {high}°: no roll "
                "angle is permitted",
                {"low": f"{self.roll_min_deg:g}", "high": f"{self.roll_max_deg:g}",
                 "slip": "the two are exchanged, or a sign is missing."},
            )  # fmt: skip
        return self

    @property
    def ranges_deg(self) -> tuple[tuple[float, float], ...]:
        """Return, for roll, pitch and yaw, the pair (lowest, highest) permitted angle in °."""
        pitch, yaw = self.pitch_max_deg, self.yaw_max_deg
        return (self.roll_min_deg, self.roll_max_deg), (-pitch, pitch), (-yaw, yaw)

    @property
    def rates_deg_per_s(self) -> tuple[float, float, float]:
        """Return the largest permitted rates of roll, pitch and yaw in °/s."""
        return (
            self.roll_rate_max_deg_per_s,
            self.pitch_rate_max_deg_per_s,
            self.yaw_rate_max_deg_per_s,
        )


class ControllerSpec(Section):
    """Gains and filters of the default controller; see `heli3dof.model.control.controller`.

    ``K`` is 2 × 8, in V/rad, V·s/rad (rates) and V/(rad·s) (integrals). Rows: front, back motor.
    Columns: errors of the angles roll r, pitch p and yaw ψ; negative rates −ṙ, −ṗ, −ψ̇; time
    integrals of the errors of r and ψ.
    """

    K: Annotated[
        tuple[tuple[Finite, ...], tuple[Finite, ...]],
        Key(
            "gain: rows front and back; columns r, p, ψ errors, rates ṙ, ṗ, ψ̇, integrals ∫r, ∫ψ",
            "V/rad, V·s/rad, V/(rad·s)", "heli3dof profile new designs it (LQR)",
        ),
    ] = Field(default=(K_G[0], K_G[1]))  # fmt: skip
    reference_rate_limit_deg_per_s: Annotated[
        Positive, Key("how fast a reference may move", "°/s")
    ] = 45.0
    integrator_clamp_V: Annotated[
        Positive, Key("largest contribution of each integral to a motor's voltage", "V")
    ] = 7.5
    derivative_cutoff_hz: Annotated[
        Positive, Key("corner of the filter that takes the rates from the angles", "Hz")
    ] = 20.0
    derivative_damping: Annotated[Positive, Key("damping ratio ζ of that filter", "–")] = 0.9

    @field_validator("K", mode="before")
    @classmethod
    def _two_by_eight(cls, value: Any) -> Any:
        rows = value if isinstance(value, list | tuple) else []
        lengths = [len(row) if isinstance(row, list | tuple) else 0 for row in rows]
        if lengths != [8, 8]:
            found = "no matrix" if not any(lengths) else f"{len(rows)} × {lengths[0]}"
            if len(set(lengths)) > 1:
                found = f"rows of {', '.join(map(str, lengths))} numbers"
            raise PydanticCustomError(
                "conflict",
                "controller.K is {found}; it must be 2 × 8: rows front and back motor, "
                "columns r p ψ ṙ ṗ ψ̇ ∫r ∫ψ",
                {"found": found,
                 "slip": "rows and columns are exchanged." if lengths == [2] * 8
                 else "the gain of another controller, or numbers are missing."},
            )  # fmt: skip
        return value

    @property
    def K_g(self) -> FloatArray:
        """Return the controller gain ``K`` (2, 8); `ControllerSpec` describes rows and columns."""
        return np.array(self.K, dtype=float)


class Profile(Section):
    """A rig's parameters: dimensions, masses, motors, encoders, limits and controller."""

    name: Annotated[str, Key("the rig's name, shown in tables and recordings")] = "unnamed"
    geometry: Geometry
    mass: Mass
    motor: Motor
    inertia: Inertia | None = None
    encoder: Encoder
    loop: Loop
    limits: Limits = Limits()
    controller: ControllerSpec | None = None
    log: LogColumns | None = None
    tolerance: Annotated[
        Positive,
        Key(
            "relative error of these numbers that a diagnosis does not report", "share",
            "0.15 for a data sheet, 0.05 for numbers that you weighed and measured", "0.15",
            (0.01, 0.5), (0.001, 2.0),
        ),
    ] = 0.15  # fmt: skip

    @property
    def trim_torque(self) -> float:
        """Return T_g = 2 L_a K_f V_o in N·m: the torque that the thrusts balance at level hover.

        L_a: yaw axis to body (m); K_f: thrust per volt (N/V); V_o: hover voltage per motor (V).
        """
        return 2 * self.geometry.L_a * self.motor.K_f * self.motor.V_o

    @property
    def gravity_torque(self) -> float:
        """Return (L_w m_w − L_a m_f − L_a m_b) g in N·m: the right-hand side of the paper's eq (5).

        With Table I's masses it is +1.170 N·m: the arm is *counterweight-heavy* (erratum E2).

        L_w, L_a: arms (m) of counterweight and body; m_w, m_f, m_b: masses (kg) of counterweight,
        front and back motor; g = 9.81 m/s².
        """
        L, m = self.geometry, self.mass
        return (L.L_w * m.m_w - L.L_a * m.m_f - L.L_a * m.m_b) * g

    @property
    def mass_inertias(self) -> tuple[float, float, float]:
        """Return J_roll, J_pitch, J_yaw in kg·m² of the level rig, computed from the masses."""
        L, m = self.geometry, self.mass
        J_pitch = (m.m_f + m.m_b) * L.L_h**2
        J_roll = m.m_w * L.L_w**2 + (m.m_f + m.m_b) * L.L_a**2
        return J_roll, J_pitch, J_roll + J_pitch

    @property
    def inertias(self) -> tuple[float, float, float]:
        """Return J_roll, J_pitch, J_yaw in kg·m² at level attitude.

        They come from the profile's section ``[inertia]``. Values that are missing there are
        computed from the masses (`mass_inertias`).
        """
        roll, pitch, yaw = self.mass_inertias
        if self.inertia is None:
            return roll, pitch, yaw
        own = self.inertia
        return own.roll or roll, own.pitch or pitch, own.yaw or yaw

    @property
    def dt(self) -> float:
        """Return the control period in s."""
        return 1.0 / self.loop.rate_hz

    @property
    def controller_is_known(self) -> bool:
        """Return True if the profile has a controller, so that the closed loop can be replayed."""
        return self.controller is not None

    def with_controller(self) -> Profile:
        """Return this profile; if it has no controller, a copy with the default controller."""
        if self.controller is not None:
            return self
        return self.model_copy(update={"controller": ControllerSpec()})

    def with_gain(self, K: ArrayLike) -> Profile:
        """Return this profile with the controller gain K; the controller's other keys stay.

        K: (2, 8), rows front and back, columns as in `ControllerSpec`. Raises ProfileError for
        another shape or a gain that is not finite.
        """
        try:
            gain = np.asarray(K, dtype=float)
        except (TypeError, ValueError):
            gain = np.array(np.nan)
        if gain.shape != (2, 8) or not np.isfinite(gain).all():
            raise ProfileError(
                f"The gain K has the shape {gain.shape}, or elements that are no finite numbers; "
                "it needs 2 × 8 numbers.",
                cause="it is transposed, or designed for another state.",
                fix="rows front, back; columns r, p, ψ errors, rates ṙ, ṗ, ψ̇, integrals ∫r, ∫ψ",
            )
        front, back = gain.tolist()
        controller = self.controller or ControllerSpec()
        controller = controller.model_copy(update={"K": (tuple(front), tuple(back))})
        return self.model_copy(update={"controller": controller})

    def __repr__(self) -> str:
        L, m, motor, e = self.geometry, self.mass, self.motor, self.encoder
        return (
            f"Profile {self.name!r}: L_w {L.L_w:g}, L_a {L.L_a:g}, L_h {L.L_h:g} m; "
            f"m_w {m.m_w:g}, m_f {m.m_f:g}, m_b {m.m_b:g} kg\n"
            f"  K_f {motor.K_f:g} N/V, V_o {motor.V_o:g} V, v_max {motor.v_max:g} V; "
            f"{e.roll}, {e.pitch}, {e.yaw} counts/rev; {self.loop.rate_hz:g} Hz\n"
            f"  controller {'known' if self.controller else 'unknown'}; "
            f"tolerance {100 * self.tolerance:g} %"
        )

    __str__ = __repr__

    def to_dict(self) -> dict[str, Any]:
        """Return the profile as nested dicts with its TOML file's keys; omit keys that are None."""
        return self.model_dump(mode="json", exclude_none=True)


def load_profile(path: str | Path) -> Profile:
    """Read a profile from a TOML file and return it.

    Raises ProfileError for a wrong key or value. The error names the file, the key and, for an
    unknown key, the nearest known one.
    """
    path = Path(path)
    return profile_from_dict(read_toml(path, "profile", ProfileError), source=str(path))


def profile_from_dict(
    data: Mapping[str, Any], *, source: str = "profile", recorded: bool = False
) -> Profile:
    """Check nested dicts, as read from TOML, and return the profile that they describe.

    ``source``: the profile's name in errors. ``recorded``: the dicts are from a recording or a
    model file, so implausible numbers are accepted. Raises ProfileError.
    """
    return check(Profile, data, source, ProfileError, recorded=recorded)


def recorded_profile(data: Mapping[str, Any]) -> Profile:
    """Return the profile in a model file's key ``profile``; raise ValueError for a wrong one."""
    try:
        return profile_from_dict(data, source="the model's profile", recorded=True)
    except ProfileError as error:
        raise ValueError(error.what) from error


TABLE_I: Mapping[str, Any] = {
    "name": "table-1",
    "geometry": {"L_w": 0.4699, "L_a": 0.6604, "L_h": 0.1778},
    "mass": {"m_w": 1.87, "m_f": 0.575, "m_b": 0.575},
    "motor": {"K_f": 0.1188, "V_o": 7.456, "v_max": 24.0},
    "encoder": {"roll": 4096, "pitch": 4096, "yaw": 8192},
    "loop": {"rate_hz": 500.0},
    "controller": {},
}
"""The paper's rig (Table I, erratum E1 corrected), flown at 500 Hz with the default controller."""


def default_profile() -> Profile:
    """Return the profile of the paper's rig, which is used when none is given."""
    return profile_from_dict(TABLE_I, source="the built-in profile")
