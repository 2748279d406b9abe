"""Effects that change how the thrust of a rotor depends on the commanded voltage of its motor."""

from __future__ import annotations

from typing import Any

from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import (
    DELAY,
    GAIN_BACK,
    GAIN_FRONT,
    K_F,
    SLEW,
    TAU_M,
    V_O,
    A,
    Stage,
    T,
)


def dead_zone(s: Any, par: Any, mem: Any, out: Any) -> None:
    """Dead zone V_d of the motors: the voltage V acts as sgn(V) max(0, |V| − V_d), both in V."""
    for i in range(2):
        over = abs(out[i]) - par[A]
        if over < 0.0:
            over = 0.0
        out[i] = over if out[i] > 0.0 else -over


def delay(s: Any, par: Any, mem: Any, out: Any) -> None:
    """A constant delay T (s): at time t the motors have the voltage that was commanded at t − T.

    In the sample interval in which a delayed voltage arrives, the motor first still has the
    previous voltage. The model uses the time-weighted mean of both voltages, exact to second order
    in the interval.
    """
    out[DELAY] += par[A]


def lag(s: Any, par: Any, mem: Any, out: Any) -> None:
    """First-order lag of each rotor's thrust F_i (N): τ_m Ḟ_i = f(V_i) − F_i, τ_m in s.

    f(V) is the steady-state thrust at the voltage V. The solution is exact: V is held between
    samples, so F approaches f(V) as exp(−t/τ_m).
    """
    out[TAU_M] = par[A]


def rotor_curve(s: Any, par: Any, mem: Any, out: Any) -> None:
    """Thrust grows as a power of the rotor's speed: F = K_f V_o (Ω/V_o)^n.

    F is the thrust (N), K_f the thrust per volt, V_o the hover voltage. Ω is the rotor's speed,
    expressed as the voltage (V) that causes it in steady state. At Ω = V_o the thrust is K_f V_o
    for every exponent n. A reversed propeller gives almost no thrust; the model gives none.

    The effect `motor.thrust_curve` describes another nonlinear thrust. It acts on the voltage
    *before* the rotor's lag, this effect on the speed after the lag. If the rotor has no lag, this
    effect and `motor.thrust_curve` with a dead zone give almost the same thrust. A flight of one
    minute does not distinguish them.
    """
    hover = s[K_F] * abs(s[V_O])
    for i in range(2):
        if out[i] <= 0.0:
            out[i] = 0.0
        else:
            out[i] = hover * (out[i] / hover) ** par[A]


def thrust_drift(s: Any, par: Any, mem: Any, out: Any) -> None:
    """Thrust F falls (d > 0) or grows with the time t (s) of the recording: F (1 − d t), d in 1/s.

    For example, a battery discharges (d > 0), or warm bearings turn more easily (d < 0).
    """
    left = 1.0 - par[A] * s[T]
    if left < 0.0:
        left = 0.0
    out[0] *= left
    out[1] *= left


def saturation(s: Any, par: Any, mem: Any, out: Any) -> None:
    """The motor voltage V saturates at a limit: it acts as clip(V, −limit, limit), all in V.

    The limit is the parameter of this effect. It is below the limit ``v_max`` of the amplifier.
    """
    for i in range(2):
        if out[i] > par[A]:
            out[i] = par[A]
        elif out[i] < -par[A]:
            out[i] = -par[A]


def spin_up(s: Any, par: Any, mem: Any, out: Any) -> None:
    """The amplifier's current limit bounds how fast a rotor spins up: dΩ/dt ≤ 1/p.

    Ω is the rotor's speed, expressed as the voltage (V) that causes it in steady state; the
    parameter p is in s/V. Spinning down has no limit. The solution is exact: a straight line while
    the limit is active, then the exponential of the effect `motor.lag`.
    """
    if par[A] > 1e-6:
        out[SLEW] = 1.0 / par[A]


def supply_sag(s: Any, par: Any, mem: Any, out: Any) -> None:
    """Supply sag under load: the voltage V acts as V (1 − k (|V_front| + |V_back|)), k in 1/V."""
    left = 1.0 - par[A] * (abs(out[0]) + abs(out[1]))
    if left < 0.0:
        left = 0.0
    out[0] *= left
    out[1] *= left


def thrust_curve(s: Any, par: Any, mem: Any, out: Any) -> None:
    """Part of the thrust grows with the square of the voltage: V acts as (1 − s) V + s V |V| / V_o.

    s = 0 is the linear law, s = 1 a propeller's F ∝ V |V|, with the thrust F. At the profile's
    hover voltage V_o the thrust is the same for every s.
    """
    for i in range(2):
        out[i] *= 1.0 - par[A] + par[A] * abs(out[i]) / abs(s[V_O])


def thrust_gain(s: Any, par: Any, mem: Any, out: Any) -> None:
    """Both motors' thrust per volt is k times the profile's K_f.

    A flight does not identify k: the gravity torque and the three inertias, divided by k, give the
    same motion (`heli3dof.model.physics.rigid_body`). This effect is for simulations.
    """
    out[GAIN_FRONT] *= par[A]
    out[GAIN_BACK] *= par[A]


def thrust_mismatch(s: Any, par: Any, mem: Any, out: Any) -> None:
    """The front motor's thrust is m times the back motor's at equal voltages; the sum is unchanged.

    The thrust per volt is K_f · 2m/(1 + m) in front and K_f · 2/(1 + m) at the back.
    """
    m = par[A]
    out[GAIN_FRONT] *= 2.0 * m / (1.0 + m)
    out[GAIN_BACK] *= 2.0 / (1.0 + m)


EFFECTS = (
    Effect(
        name="motor.dead_zone",
        summary="No thrust up to a voltage V_d; above it, the thrust of |V| − V_d.",
        parameters=(Parameter("voltage_V", "V", 0.0, 0.0, 8.0, 1.0, "V_d", start=0.3),),
        hooks={Stage.VOLTAGE: dead_zone},
        order=4,
        confused_with=("motor.thrust_curve", "mass.imbalance", "stiffness.pendulum"),
        separated_by="large",
        identifiable="several levels of thrust, and voltages near zero",
        evidence="voltage_front",
        probes=((0.3,), (1.5,)),
    ),
    Effect(
        name="motor.delay",
        summary="The voltage reaches the motors after a constant delay.",
        parameters=(Parameter("delay_s", "s", 0.0, 0.0, 0.2, 0.01, "the delay", start=0.002),),
        hooks={Stage.SETUP: delay},
        confused_with=("motor.lag",),
        separated_by="chirp",
        identifiable="quick changes of voltage: doublets, a multisine or a chirp on pitch",
        evidence="voltage_difference",
        probes=((0.004,), (0.02,)),
    ),
    Effect(
        name="motor.lag",
        summary="The rotors follow the voltage with a first-order lag.",
        parameters=(
            Parameter(
                "time_constant_s",
                "s",
                0.0,
                1e-3,
                1.0,
                0.1,
                "τ_m",
                log=True,
                prior_std=1.0,
                start=0.08,
            ),
        ),
        hooks={Stage.SETUP: lag},
        confused_with=("motor.delay",),
        separated_by="chirp",
        identifiable="quick changes of voltage: doublets, a multisine or a chirp on pitch",
        evidence="voltage_difference",
        probes=((0.02,), (0.07,), (0.2,)),
    ),
    Effect(
        name="motor.rotor_curve",
        summary="Thrust grows as a power of the rotor's speed, behind the lag.",
        parameters=(Parameter("exponent", "–", 1.0, 0.4, 4.0, 0.5, "n", prior_std=1.0, start=1.5),),
        hooks={Stage.THRUST: rotor_curve},
        order=1,
        confused_with=("motor.thrust_curve", "motor.dead_zone"),
        separated_by="large",
        identifiable="several levels of thrust with quick changes between",
        evidence="voltage_sum",
        requires="motor.lag",
    ),
    Effect(
        name="motor.saturation",
        summary="The motor voltage saturates below the amplifier's limit.",
        parameters=(Parameter("limit_V", "V", 100.0, 1.0, 100.0, 10.0, "the limit", start=12.0),),
        hooks={Stage.VOLTAGE: saturation},
        order=3,
        confused_with=("motor.supply_sag",),
        separated_by="large",
        identifiable="voltages above the limit",
        evidence="voltage_sum",
        probe_quantiles=(0.999, 0.995, 0.98, 0.95, 0.88),
    ),
    Effect(
        name="motor.spin_up",
        summary="The rotor speed, in volts, grows by at most 1/p V per second.",
        parameters=(
            Parameter("slowness_s_per_V", "s/V", 0.0, 0.0, 0.5, 0.02, "p, 1/slew", start=0.015),
        ),
        hooks={Stage.SETUP: spin_up},
        order=1,
        confused_with=("motor.lag", "motor.delay", "motor.saturation"),
        separated_by="large",
        identifiable="large steps of voltage upwards",
        evidence="voltage_sum",
    ),
    Effect(
        name="motor.supply_sag",
        summary="The supply sags under load: V (1 − k (|V_f| + |V_b|)).",
        parameters=(Parameter("sag_per_V", "1/V", 0.0, -0.01, 0.03, 0.003, "k"),),
        hooks={Stage.VOLTAGE: supply_sag},
        order=2,
        confused_with=("motor.thrust_curve", "motor.saturation"),
        separated_by="large",
        identifiable="a wide range of both motors' voltage",
        evidence="voltage_sum",
    ),
    Effect(
        name="motor.thrust_curve",
        summary="Part of the thrust grows with V².",
        parameters=(Parameter("quadratic_share", "–", 0.0, -1.0, 2.0, 0.3, "s"),),
        hooks={Stage.VOLTAGE: thrust_curve},
        order=5,
        confused_with=("motor.dead_zone", "motor.supply_sag", "stiffness.pendulum"),
        separated_by="large",
        identifiable="several levels of thrust",
        evidence="voltage_sum",
    ),
    Effect(
        name="motor.thrust_drift",
        summary="Thrust falls with time, as on a battery: F (1 − d t).",
        parameters=(Parameter("loss_per_s", "1/s", 0.0, -0.005, 0.01, 3e-4, "d"),),
        hooks={Stage.THRUST: thrust_drift},
        order=9,
        confused_with=("mass.change", "motor.supply_sag"),
        separated_by="levels",
        identifiable="a long flight",
        evidence="time",
    ),
    Effect(
        name="motor.thrust_gain",
        summary="Both motors give k times the thrust of the profile's K_f.",
        parameters=(Parameter("gain", "–", 1.0, 0.2, 4.0, 0.2, "k", prior_std=0.15),),
        hooks={Stage.SETUP: thrust_gain},
        confused_with=("mass.imbalance", "inertia"),
        separated_by="levels",
        identifiable="a weighed part; otherwise equivalent to a scale of all masses",
        evidence="voltage_sum",
        candidate=False,  # equivalent to a parameter of the rigid body
    ),
    Effect(
        name="motor.thrust_mismatch",
        summary="The front motor thrusts m times as much as the back one.",
        parameters=(Parameter("front_over_back", "–", 1.0, 0.4, 2.5, 0.05, "m", prior_std=0.3),),
        hooks={Stage.SETUP: thrust_mismatch},
        confused_with=("bias.torque.pitch", "encoder.offset.pitch"),
        separated_by="large",
        identifiable="the thrust varied: the torque on pitch grows with it",
        evidence="voltage_sum",
    ),
)
