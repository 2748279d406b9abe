"""Formulas of the hidden effects, and the sizes at which they can be drawn.

Voltages V_f, V_b (V) at the motors, thrusts F (N), thrust per volt K_f (N/V), hover voltage V_o::

    saturation, sag   V → clip(V, ± limit);   V → V (1 − k (|V_f| + |V_b|))
    dead zone, curve  V → V ∓ d, 0 within ± d;   V → (1 − s) V + s V |V| / V_o
    mismatch          F_f = √m K_f V_f,   F_b = K_f V_b / √m
    ground            F / (1 − (R / 4z)²) with R in m, or F (1 + g exp(−z / l));
                      rotor height z = 0.31 m + L_a sin r ± L_h sin p cos r
    inflow            F − K_f k |V| w, w in m/s: speed of the rotor along its thrust

Torques in N·m on the axes r, p, ψ; ω is the body's angular velocity, u the thrust's direction::

    friction, drag    −d q̇,   −c q̇ |q̇|;   Coulomb: an impulse of at most τ dt that ends the motion
    stiffness         −k sin q (pendulum),   −k ψ (cable)
    bias, periodic    τ,   τ sin(2π f t + φ)
    imbalance         −τ cos r on roll
    reaction          T = k (V_f |V_f| ± V_b |V_b|) along u;  −: counter-rotating propellers
    gyroscopic        −ω × H u,   H = h (V_f + V_b)

Encoder: reading = scale · angle + offset, behind a backlash of full width w.
Outside the catalogue: `OUTSIDE` lists the torques' products.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.hidden.sizes import axis_of
from tests.hidden.third_plant import body, kernel

AXES = ("roll", "pitch", "yaw")
HEIGHT_M = 0.31
"""Rotor height of the level rig"""
LEAST_HEIGHT = 0.35
"""Of the radius R: the ground formula is not valid lower"""
HIGHEST_LIMIT_V = 14.0
"""Above every voltage of a flight without effects"""
DELAY_STEP_S = 5e-4
"""Delays are multiples of it, as integration steps divide it"""

_EACH_AXIS = (
    "coulomb", "viscous", "quadratic", "pendulum", "bias", "periodic_Nm", "periodic_Hz",
    "periodic_rad", "backlash_rad", "offset_rad", "scale",
)  # fmt: skip
_ONCE = (
    "K_f", "V_o", "cable", "imbalance", "lag_s", "delay_s", "dead_zone_V", "curve", "mismatch",
    "limit_V", "sag_per_V", "ground_radius_m", "ground_gain", "ground_length_m", "reaction",
    "reaction_back", "inflow", "gyroscopic", "weight_kg", "weight_at_s", "roll_rate_voltage",
    "yaw_squared", "sin_2yaw", "yaw_rate_squared", "yaw_rate_voltage",
)  # fmt: skip
RIG = np.dtype(
    [*body.FIELDS, *((n, "f8", 3) for n in _EACH_AXIS), *((n, "f8") for n in _ONCE)]
)  # fmt: skip


@kernel
def at_motors(front_V: float, back_V: float, rig: Any) -> tuple[float, float]:
    """The voltages behind limiter and supply."""
    f = min(max(front_V, -rig.limit_V), rig.limit_V)
    b = min(max(back_V, -rig.limit_V), rig.limit_V)
    share = max(0.0, 1.0 - rig.sag_per_V * (abs(f) + abs(b)))
    return share * f, share * b


@kernel
def static_thrust(V: float, rig: Any) -> float:
    """The thrust of a motor at rest in the air, without mismatch."""
    V = math.copysign(max(abs(V) - rig.dead_zone_V, 0.0), V)
    return float(rig.K_f * ((1.0 - rig.curve) * V + rig.curve * V * abs(V) / rig.V_o))


@kernel
def _near_ground(F: float, z: float, rig: Any) -> float:
    z = max(z, LEAST_HEIGHT * rig.ground_radius_m, 1e-3)
    F /= 1.0 - (rig.ground_radius_m / (4.0 * z)) ** 2
    return float(F * (1.0 + rig.ground_gain * math.exp(-z / rig.ground_length_m)))


@kernel
def thrusts(
    x: np.ndarray, front: float, back: float, front_V: float, back_V: float, rig: Any
) -> tuple[float, float]:
    """The thrusts of the moving rotors near the ground."""
    cr, sr, cp, sp = math.cos(x[0]), math.sin(x[0]), math.cos(x[1]), math.sin(x[1])
    middle, side = HEIGHT_M + rig.L_a * sr, rig.L_h * sp * cr
    w = rig.L_a * (cp * x[3] - cr * sp * x[5])
    dw = rig.L_h * (x[4] + sr * x[5])
    front = _near_ground(front, middle + side, rig)
    back = _near_ground(back, middle - side, rig)
    front -= rig.K_f * rig.inflow * abs(front_V) * (w + dw)
    back -= rig.K_f * rig.inflow * abs(back_V) * (w - dw)
    return front, back


@kernel
def add_torques(
    x: np.ndarray, t: float, front_V: float, back_V: float, rig: Any, Q: np.ndarray
) -> None:
    """Add the effects' torques to Q (3,)."""
    cr, sr, cp, sp = math.cos(x[0]), math.sin(x[0]), math.cos(x[1]), math.sin(x[1])
    dr, dp, dy = x[3], x[4], x[5]
    for i in range(3):
        rate = x[3 + i]
        Q[i] += rig.bias[i] - rig.viscous[i] * rate - rig.quadratic[i] * rate * abs(rate)
        Q[i] -= rig.pendulum[i] * math.sin(x[i])
        phase = 2.0 * math.pi * rig.periodic_Hz[i] * t + rig.periodic_rad[i]
        Q[i] += rig.periodic_Nm[i] * math.sin(phase)
    Q[0] -= rig.imbalance * cr
    Q[2] -= rig.cable * x[2]
    T = rig.reaction * (front_V * abs(front_V) + rig.reaction_back * back_V * abs(back_V))
    Q[0] += T * sp
    Q[2] += T * cp * cr
    # −ω × H u, by the components along e, t and z, then along the joints' axes −t, a and z.
    H, total_V = rig.gyroscopic * (front_V + back_V), front_V + back_V
    w_e, w_t, w_z = dp * cr, -dr, dy + dp * sr
    u_e, u_t, u_z = -cp * sr, -sp, cp * cr
    Q[0] += H * (w_z * u_e - w_e * u_z)
    Q[1] -= H * ((w_t * u_z - w_z * u_t) * cr + (w_e * u_t - w_t * u_e) * sr)
    Q[2] -= H * (w_e * u_t - w_t * u_e)
    Q[0] += rig.yaw_rate_voltage * dy * total_V
    Q[1] += rig.yaw_rate_squared * dy * abs(dy)
    Q[2] += rig.roll_rate_voltage * dr * total_V - rig.yaw_squared * x[2] * abs(x[2])
    Q[2] += rig.sin_2yaw * math.sin(2.0 * x[2])


@kernel
def dry_friction(x: np.ndarray, before: np.ndarray, dt: float, W: np.ndarray, rig: Any) -> None:
    """Change the rates by Coulomb's impulses, with W = M⁻¹; an axis at rest keeps its angle."""
    for i in range(3):
        limit = rig.coulomb[i] * dt
        if limit > 0.0:
            impulse = -x[3 + i] / W[i, i]
            sticks = abs(impulse) <= limit
            impulse = min(max(impulse, -limit), limit)
            for j in range(3):
                x[3 + j] += impulse * W[i, j]
            if sticks:
                x[3 + i] = 0.0
                if before[3 + i] == 0.0:
                    x[i] = before[i]


@kernel
def follow(seen: np.ndarray, x: np.ndarray, rig: Any) -> None:
    """Move the encoders' shafts ``seen`` (3,) behind their backlash."""
    for i in range(3):
        half = 0.5 * rig.backlash_rad[i]
        seen[i] = min(max(seen[i], x[i] - half), x[i] + half)


ONE_WAY, SIGN, AROUND_ONE, FACTOR, BELOW = "s", "± s", "1 ± s", "(1 + s)^± 1", "limit − s"


@dataclass(frozen=True)
class Effect:
    """A contract's effect: the rig's field that holds its value, and the range of its size s.

    ``way``: how the value follows from s. An effect that is not ``sized`` by the signal ratio is
    drawn from its range.
    """

    name: str
    field: str
    low: float
    high: float
    way: str = ONE_WAY
    sized: bool = True

    @property
    def axis(self) -> int | None:
        axis = axis_of(self.name)
        return AXES.index(axis) if axis else None

    def value(self, size: float, sign: float) -> float:
        """The contract's parameter, in its unit."""
        if self.name == "motor.delay":
            size = max(1, round(size / DELAY_STEP_S)) * DELAY_STEP_S
        by_way = {
            ONE_WAY: size, SIGN: sign * size, AROUND_ONE: 1 + sign * size,
            FACTOR: (1 + size) ** sign, BELOW: HIGHEST_LIMIT_V - size,
        }  # fmt: skip
        return float(by_way[self.way])

    def hide(self, rig: Any, value: float) -> None:
        """Write the value to the rig's record."""
        reference = nominal()
        if self.name.startswith("inertia."):
            value = value * body.inertias(reference)[self.axis] - body.inertias(rig)[self.axis]
        elif self.name == "mass.imbalance":
            value -= body.trim_torque(rig) - body.trim_torque(reference)
        elif self.name == "motor.thrust_gain":
            value *= reference["K_f"]
        elif self.field.endswith("_rad"):
            value = math.radians(value)
        self.write(rig, self.field, value)

    def write(self, rig: Any, field: str, value: float) -> None:
        """Write a field, of a field with three axes the effect's own."""
        if RIG[field].shape:
            rig[field][self.axis] = value
        else:
            rig[field] = value


def nominal() -> Any:
    """The record of the profile's rig, without effects; it hovers at V_o = T_g / (2 L_a K_f)."""
    rig = np.zeros(1, RIG)[0]
    for name, value in (
        ("L_w", 0.4699), ("L_a", 0.6604), ("L_h", 0.1778), ("m_w", 1.87), ("m_f", 0.713),
        ("m_b", 0.713), ("K_f", 0.1188), ("scale", 1.0), ("mismatch", 1.0), ("limit_V", 1e9),
        ("ground_length_m", 1.0), ("reaction_back", 1.0),
    ):  # fmt: skip
        rig[name] = value
    rig["V_o"] = body.trim_torque(rig) / (2 * rig["L_a"] * rig["K_f"])
    return rig


def _each(
    name: str, field: str, low: float, high: tuple[float, ...], way: str = ONE_WAY
) -> tuple[Effect, ...]:
    """The effect on each axis."""
    return tuple(Effect(f"{name}.{a}", field, low, h, way) for a, h in zip(AXES, high, strict=True))


_T_G = body.trim_torque(nominal())
_TABLE = (
    *_each("friction.coulomb", "coulomb", 1e-4, (0.15, 0.03, 0.15)),
    *_each("friction.viscous", "viscous", 1e-4, (0.8, 0.15, 0.5)),
    *_each("drag.quadratic", "quadratic", 1e-4, (2.0, 0.2, 1.5)),
    Effect("stiffness.pendulum.roll", "pendulum", 1e-3, 3.2),
    Effect("stiffness.pendulum.pitch", "pendulum", 1e-3, 0.06),
    Effect("stiffness.cable.yaw", "cable", 1e-3, 0.6),
    Effect("bias.torque.pitch", "bias", 1e-4, 0.03, SIGN),
    Effect("bias.torque.yaw", "bias", 1e-4, 0.15, SIGN),
    Effect("mass.imbalance", "imbalance", 0.2 * _T_G, 0.45 * _T_G, SIGN, sized=False),
    *(Effect(f"inertia.{a}", "added_inertia", 0.2, 0.45, AROUND_ONE, sized=False) for a in AXES),
    Effect("motor.lag", "lag_s", 0.004, 0.25),
    Effect("motor.delay", "delay_s", 0.001, 0.1),
    Effect("motor.dead_zone", "dead_zone_V", 0.05, 2.5),
    Effect("motor.thrust_curve", "curve", 0.01, 1.0),
    Effect("motor.thrust_gain", "K_f", 0.2, 0.45, AROUND_ONE, sized=False),
    Effect("motor.thrust_mismatch", "mismatch", 0.003, 0.3, FACTOR),
    Effect("motor.saturation", "limit_V", 1.0, 9.5, BELOW),
    Effect("motor.supply_sag", "sag_per_V", 2e-4, 0.03),
    Effect("aero.ground_effect", "ground_gain", 0.01, 3.0),
    Effect("aero.reaction_torque", "reaction", 1e-6, 4e-3, SIGN),
    Effect("aero.inflow", "inflow", 2e-3, 0.5),
    Effect("aero.gyroscopic", "gyroscopic", 5e-5, 0.03, SIGN),
    Effect("mass.change", "weight_kg", 2e-4, 0.12, SIGN),
    *_each("encoder.backlash", "backlash_rad", 0.02, (4.0, 4.0, 4.0)),
    *(Effect(f"encoder.offset.{a}", "offset_rad", 0.1, 8.0, SIGN, a != "yaw") for a in AXES),
    *_each("encoder.scale", "scale", 0.005, (0.25, 0.25, 0.25), AROUND_ONE),
    *_each("disturbance.periodic", "periodic_Nm", 1e-4, (0.4, 0.06, 0.4)),
    Effect("other.yaw_torque_from_roll_rate_and_voltage", "roll_rate_voltage", 1e-4, 0.1, SIGN),
    Effect("other.yaw_torque_from_yaw_squared", "yaw_squared", 0.01, 3.0),
    Effect("other.yaw_torque_from_twice_yaw", "sin_2yaw", 1e-3, 0.3, SIGN),
    Effect("other.pitch_torque_from_yaw_rate_squared", "yaw_rate_squared", 1e-3, 1.0, SIGN),
    Effect("other.roll_torque_from_yaw_rate_and_voltage", "yaw_rate_voltage", 1e-4, 0.1, SIGN),
)
EFFECTS = {e.name: e for e in _TABLE}
CHEESEMAN_BENNETT = Effect("aero.ground_effect", "ground_radius_m", 0.03, 0.32)
"""The second formula of the ground effect; each case draws one of the two"""

OUTSIDE = {
    "other.yaw_torque_from_roll_rate_and_voltage": "roll_rate*voltage_sum",
    "other.yaw_torque_from_yaw_squared": "abs(yaw)*yaw",
    "other.yaw_torque_from_twice_yaw": "sin(yaw)*cos(yaw)",
    "other.pitch_torque_from_yaw_rate_squared": "abs(yaw_rate)*yaw_rate",
    "other.roll_torque_from_yaw_rate_and_voltage": "yaw_rate*voltage_sum",
}
"""Hidden effect outside the catalogue → product of its torque"""
