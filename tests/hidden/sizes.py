"""Sizes of the hidden effects: small, medium and large, fixed before any seed was drawn.

- small: near the 5 σ limit of one rich flight of 60 s;
- medium: noticeable to a teacher;
- large: spoils a demonstration, but still flies inside the envelope (`tests.hidden.survey` checks
  it).

Values are in the units of mock.md. The limits of "small" follow from the random torques of the
emulated rig (0.035, 0.0035, 0.015 N·m, correlated over τ_c = 10 ms): the size of a torque of known
shape is estimated with σ = σ_w √(2 τ_c / T) / (RMS of its shape).

A base parameter (`mass.imbalance`, `inertia`, `motor.thrust_gain`) is a finding only beyond the
profile's tolerance of 15 %, and the rig's own parameters are drawn within ± 7 % of the profile's,
K_f among them: together up to 1.07/0.93. So all three sizes lie beyond 1.15 · 1.07/0.93.
"""

from __future__ import annotations

from dataclasses import dataclass

SIZES = ("small", "medium", "large")
RATIO, SIGN, ONE_WAY = "or its inverse", "either sign", "one sign"


@dataclass(frozen=True)
class Effect:
    """An effect on its axis with its hidden sizes.

    ``parameter`` is the contract's name of its first parameter, ``null`` the value without effect,
    ``reason`` the origin of the sizes.
    """

    name: str
    parameter: str
    sizes: tuple[float, float, float]
    reason: str
    way: str = ONE_WAY
    null: float = 0.0


_TABLE = (
    Effect("friction.coulomb.roll", "torque_Nm", (0.015, 0.04, 0.1),
            "limit 0.011 rad/s² · J_r = 0.010; a dry slip ring 0.03 to 0.1"),
    Effect("friction.coulomb.pitch", "torque_Nm", (0.002, 0.005, 0.012),
            "limit 0.034 rad/s² · J_p = 0.0012"),
    Effect("friction.coulomb.yaw", "torque_Nm", (0.008, 0.02, 0.05),
            "limit 0.005 rad/s² · J_ψ = 0.005; yaw stops short of its target from 0.02"),
    Effect("friction.viscous.roll", "damping_Nms_per_rad", (0.04, 0.1, 0.25),
            "rigs have 0.04 to 0.06 1/s · J_r"),
    Effect("friction.viscous.pitch", "damping_Nms_per_rad", (0.006, 0.02, 0.05),
            "rigs have 0.04 to 2.5 1/s · J_p = 0.0015 to 0.09"),
    Effect("friction.viscous.yaw", "damping_Nms_per_rad", (0.03, 0.08, 0.2),
            "rigs have 0.02 to 0.27 1/s · J_ψ"),
    Effect("drag.quadratic.roll", "drag_Nms2_per_rad2", (0.15, 0.4, 1.0),
            "as viscous friction at 0.25 rad/s"),
    Effect("drag.quadratic.pitch", "drag_Nms2_per_rad2", (0.02, 0.06, 0.15),
            "as viscous friction at 0.3 rad/s"),
    Effect("drag.quadratic.yaw", "drag_Nms2_per_rad2", (0.08, 0.2, 0.6),
            "as viscous friction at 0.35 rad/s"),
    Effect("stiffness.pendulum.roll", "torque_Nm", (0.1, 0.4, 1.0),
            "k/J_r = ω²: 0.33, 0.66, 1.05 rad/s; rigs have 1.0 to 1.8"),
    Effect("stiffness.pendulum.pitch", "torque_Nm", (0.003, 0.01, 0.03),
            "k/J_p = ω²: 0.29, 0.52, 0.91 rad/s; rigs have 0.17 to 0.93"),
    Effect("stiffness.cable.yaw", "stiffness_Nm_per_rad", (0.015, 0.05, 0.15),
            "at 30° of yaw 0.008, 0.026, 0.08 N·m against a noise of 0.015", ONE_WAY),
    Effect("bias.torque.pitch", "torque_Nm", (0.002, 0.008, 0.025),
            "1 % of thrust mismatch is 0.0016 N·m; bodies are lopsided by a few per cent", SIGN),
    Effect("bias.torque.yaw", "torque_Nm", (0.004, 0.015, 0.05),
            "the last one holds the rig 1.6° in pitch", SIGN),
    Effect("mass.imbalance", "torque_Nm", (0.36, 0.45, 0.55),
            "31, 38, 47 % of T_g = 1.17 N·m, beyond tolerance and spread", SIGN),
    *(Effect(f"inertia.{axis}", "ratio", (1.4, 1.55, 1.7),
             "beyond tolerance and spread; a mass added far out", RATIO, 1.0)
      for axis in ("roll", "pitch", "yaw")),
    Effect("motor.lag", "time_constant_s", (0.01, 0.03, 0.08),
           "limit as the delay's, 3 ms; rigs have 0.03 to 0.2 s, 0.1 s leaves pitch ringing"),
    Effect("motor.delay", "delay_s", (0.005, 0.015, 0.03),
           "limit 2.8 ms; a slow bus, a Bluetooth link"),
    Effect("motor.dead_zone", "voltage_V", (0.3, 1.0, 2.0),
           "hover at 7.5 V is 0.3 V higher; real motors do nothing below about 2 V"),
    Effect("motor.thrust_curve", "quadratic_share", (0.08, 0.3, 0.7), "limit 5 %"),
    Effect("motor.thrust_gain", "gain", (1.4, 1.55, 1.7),
           "beyond tolerance and spread; sources differ by a factor of two", RATIO, 1.0),
    Effect("motor.thrust_mismatch", "front_over_back", (1.01, 1.04, 1.12),
           "limit 0.4 %; rigs have 1 to 10 %", RATIO, 1.0),
    Effect("motor.saturation", "limit_V", (12.5, 11.0, 10.0),
           "hover is 7.5 V, the hundredth highest sample of a rich flight 11.6 V", null=24.0),
    Effect("motor.supply_sag", "sag_per_V", (0.0015, 0.004, 0.01), "at 15 V 2 to 15 %"),
    Effect("aero.ground_effect", "thrust_share", (0.08, 0.2, 0.4),
           "a fifth of it is left at −12°, a twentieth level"),
    Effect("aero.reaction_torque", "torque_per_thrust_m", (0.003, 0.012, 0.04),
           "κF = 0.005, 0.02, 0.07 N·m on yaw", SIGN),
    Effect("aero.inflow", "loss_s_per_m", (0.08, 0.25, 0.6),
           "damps roll with F k L_a² = 0.06, 0.19, 0.46 N·m·s/rad"),
    Effect("aero.gyroscopic", "momentum_Nms_per_V", (0.0005, 0.002, 0.005),
            "15 V · 0.3 rad/s: 0.002, 0.009, 0.02 N·m on pitch", SIGN),
    Effect("mass.change", "mass_kg", (0.005, 0.015, 0.04),
            "6.5 N·m/kg on roll: 0.03, 0.1, 0.26 N·m; a coin, a bolt, a phone's battery"),
    *(Effect(f"encoder.backlash.{axis}", "angle_deg", sizes,
             "two to twelve encoder steps; couplings have 0.2 to 1°")
      for axis, sizes in (("roll", (0.2, 0.5, 1.0)), ("pitch", (0.2, 0.5, 1.0)),
                          ("yaw", (0.2, 0.5, 1.0)))),
    Effect("encoder.offset.roll", "angle_deg", (1.0, 3.0, 6.0),
           "T_g sin δ = 0.02, 0.06, 0.12 N·m of pendulum", SIGN),
    Effect("encoder.offset.pitch", "angle_deg", (0.3, 1.0, 3.0),
           "F L_a sin δ = 0.006, 0.02, 0.06 N·m on yaw", SIGN),
    Effect("encoder.offset.yaw", "angle_deg", (1.0, 5.0, 15.0),
           "nothing depends on where yaw's zero is: not to be found at any size", SIGN),
    *(Effect(f"encoder.scale.{axis}", "scale", (1.05, 1.12, 1.25),
             "a wrong line count or gear; mostly another inertia (see equivalences)", RATIO, 1.0)
      for axis in ("roll", "pitch", "yaw")),
    Effect("disturbance.periodic.roll", "torque_Nm", (0.015, 0.05, 0.12),
            "limit 5 σ_w √(2 τ_c/T) √2 = 0.0045; a third to four times the random torque"),
    Effect("disturbance.periodic.pitch", "torque_Nm", (0.0015, 0.005, 0.012), "the same"),
    Effect("disturbance.periodic.yaw", "torque_Nm", (0.006, 0.02, 0.05), "the same"),
    Effect("timing.gaps", "lost_share", (0.003, 0.01, 0.04), "every 300th is lost"),
    Effect("timing.jitter", "jitter_s", (0.0001, 0.0003, 0.0006), "5, 15, 30 % of a period"),
)  # fmt: skip

EFFECTS = {e.name: e for e in _TABLE}
"""Name with axis → sizes. `geometry` is not listed: the rig always has it."""

_OUTSIDE = (
    Effect("other.yaw_torque_from_pitch_rate", "damping_Nms_per_rad", (0.05, 0.12, 0.3),
            "at 0.3 rad/s the noise's size, two, six times", SIGN),
    Effect("other.roll_torque_from_yaw_angle", "torque_Nm", (0.05, 0.15, 0.35),
            "a base tilted by 2.5, 7, 17°", SIGN),
    Effect("other.pitch_torque_from_voltage_product", "torque_Nm_per_V2",
            (0.0001, 0.0003, 0.0006), "at hover 0.006, 0.017, 0.033 N·m; half of it varies", SIGN),
    Effect("other.yaw_torque_from_roll_rate_squared", "drag_Nms2_per_rad2", (0.3, 0.8, 2.0),
            "at 0.25 rad/s 0.02, 0.05, 0.12 N·m", SIGN),
)  # fmt: skip

OUTSIDE = {e.name: e for e in _OUTSIDE}
"""Effects outside the catalogue; the axis on which each acts follows "other."."""


def axis_of(name: str) -> str | None:
    """The axis in an effect's name; outside the catalogue, the axis on which it acts."""
    if name.startswith("other."):
        return name.removeprefix("other.").split("_", 1)[0]
    last = name.rsplit(".", 1)[-1]
    return last if last in ("roll", "pitch", "yaw") else None
