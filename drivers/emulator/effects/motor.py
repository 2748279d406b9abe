"""Effects of the motors, from the commanded voltage to the thrust, along the signal's path.

V is one motor's voltage (V_f front, V_b back, V_o at hover), F its thrust, K_f the profile's thrust
per volt. T, k, V_d, s, m, τ_m, d and ``limit`` are the effects' parameters:

1. ``motor.delay``: V(t − T), averaged exactly over each integration substep.
2. ``motor.supply_sag``: the supply voltage drops under load: V (1 − k (|V_f| + |V_b|)).
3. ``motor.saturation``: |V| ≤ ``limit``, below the amplifier's own limit.
4. ``motor.dead_zone``: zero for |V| below V_d, and V − V_d sgn V above.
5. ``motor.thrust_curve``: V → (1 − s) V + s V |V| / V_ref: a share s of the thrust is quadratic in
   V. At V_ref = |V_o| the thrust remains K_f V.
6. ``motor.thrust_gain``: the thrust of both motors times k; ``motor.thrust_mismatch``:
   F_f : F_b = m : 1 at equal voltages, with their sum unchanged.
7. ``motor.lag``: τ_m Ḟ = K_f V − F for each rotor.
8. ``motor.thrust_drift``: F (1 − d t), but at least 0; t: time on the device's clock (s).
"""

from __future__ import annotations

from dataclasses import replace

from ..body import Setup
from ..plant_effects import Row, kernel
from ..plant_layout import V_BACK, V_FRONT, V_REF, V_START, A, H, Stage, T
from .base import Effect, Parameter

LONGEST_DELAY_S = 0.1
SLOTS = 500
"""Number of substeps whose voltages the delay stores. They last 0.1 s at control rates up to
1245 Hz; at higher rates the longest delay is shorter"""


@kernel
def delay(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    # mem: [number of substeps seen, then SLOTS pairs of voltages, one a substep, as a ring]
    seen = int(mem[0])
    if seen == 0:
        for i in range(SLOTS):
            mem[1 + 2 * i] = s[V_START]
            mem[2 + 2 * i] = s[V_START]
    here = seen % SLOTS
    mem[1 + 2 * here], mem[2 + 2 * here] = out[0], out[1]
    mem[0] = seen + 1
    back = min(par[A] / s[H], SLOTS - 2.0)
    whole = int(back)
    part = back - whole
    i = 1 + 2 * ((seen - whole) % SLOTS)
    j = 1 + 2 * ((seen - whole - 1) % SLOTS)
    out[0] = (1 - part) * mem[i] + part * mem[j]
    out[1] = (1 - part) * mem[i + 1] + part * mem[j + 1]


@kernel
def supply_sag(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    left = max(0.0, 1 - par[A] * (abs(out[0]) + abs(out[1])))
    out[0] *= left
    out[1] *= left


@kernel
def thrust_drift(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    left = max(0.0, 1 - par[A] * s[T])
    out[0] *= left
    out[1] *= left


@kernel
def saturation(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    for i in range(2):
        out[i] = min(par[A], max(-par[A], out[i]))


@kernel
def dead_zone(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    for i in range(2):
        over = max(0.0, abs(out[i]) - par[A])
        out[i] = over if out[i] > 0 else -over


@kernel
def thrust_curve(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    for i in range(2):
        out[i] *= 1 - par[A] + par[A] * abs(out[i]) / body[V_REF]


def _gain(setup: Setup, axis: int, values: tuple[float, ...]) -> Setup:
    front, back = setup.body.gain
    k = values[0]
    return replace(setup, body=replace(setup.body, gain=(front * k, back * k)))


def _mismatch(setup: Setup, axis: int, values: tuple[float, ...]) -> Setup:
    front, back = setup.body.gain
    m = values[0]
    gain = (front * 2 * m / (1 + m), back * 2 / (1 + m))
    return replace(setup, body=replace(setup.body, gain=gain))


def _lag(setup: Setup, axis: int, values: tuple[float, ...]) -> Setup:
    return replace(setup, body=replace(setup.body, tau_m=values[0]))


assert V_FRONT + 1 == V_BACK

EFFECTS = (
    Effect(
        name="motor.delay",
        summary="The voltage reaches the motors later.",
        parameters=(Parameter("delay_s", "s", 0.0, LONGEST_DELAY_S, "the delay"),),
        example="motor.delay:0.02",
        kernels={Stage.VOLTAGE: delay},
        order=1,
    ),
    Effect(
        name="motor.supply_sag",
        summary="The supply sags under load: V (1 − k (|V_f| + |V_b|)).",
        parameters=(Parameter("sag_per_V", "1/V", 0.0, 0.02, "k, share lost per summed volt"),),
        example="motor.supply_sag:0.005",
        kernels={Stage.VOLTAGE: supply_sag},
        order=2,
    ),
    Effect(
        name="motor.saturation",
        summary="The voltage at the motors is limited, below the amplifier's limit.",
        parameters=(Parameter("limit_V", "V", 1.0, 100.0, "the limit on |V|"),),
        example="motor.saturation:10",
        kernels={Stage.VOLTAGE: saturation},
        order=3,
    ),
    Effect(
        name="motor.dead_zone",
        summary="No thrust below this voltage; above, the voltage is reduced by it.",
        parameters=(Parameter("voltage_V", "V", 0.0, 6.0, "half the zone's width"),),
        example="motor.dead_zone:1.0",
        kernels={Stage.VOLTAGE: dead_zone},
        order=4,
    ),
    Effect(
        name="motor.thrust_curve",
        summary="Part of the thrust is quadratic in V; at V_o it equals the linear thrust.",
        parameters=(Parameter("quadratic_share", "–", -0.5, 1.0, "share s"),),
        example="motor.thrust_curve:0.5",
        kernels={Stage.VOLTAGE: thrust_curve},
        order=5,
    ),
    Effect(
        name="motor.thrust_gain",
        summary="The thrust of both motors is k times K_f V.",
        parameters=(Parameter("gain", "–", 0.3, 3.0, "k"),),
        example="motor.thrust_gain:0.9",
        setup=_gain,
        order=6,
    ),
    Effect(
        name="motor.thrust_drift",
        summary="Thrust falls with time: F (1 − d t).",
        parameters=(Parameter("loss_per_s", "1/s", -0.01, 0.01, "d"),),
        example="motor.thrust_drift:0.001",
        kernels={Stage.THRUST: thrust_drift},
    ),
    Effect(
        name="motor.thrust_mismatch",
        summary="The front motor's thrust is m times the back one's; their sum is unchanged.",
        parameters=(Parameter("front_over_back", "–", 0.5, 2.0, "m"),),
        example="motor.thrust_mismatch:1.05",
        setup=_mismatch,
        order=6,
    ),
    Effect(
        name="motor.lag",
        summary="The rotors follow with a first-order lag: τ Ḟ = K_f V − F.",
        parameters=(Parameter("time_constant_s", "s", 0.0, 1.0, "τ"),),
        example="motor.lag:0.1",
        setup=_lag,
        order=7,
    ),
)
