"""Simulates flights that end in a trip, and the arm's motion under the voltages that follow.

The plant is the profile's rigid body (`heli3dof.model.physics.rigid_body`) with a table under the
arm (inelastic) and pitch stops. Thrust gain, motor mismatch, T_g, inertias and rotor lag are drawn
for each flight. A `Situation` is the flight until the trip: the default controller, with or without
a fault, then perhaps fixed voltages. The trip comes at a random moment, or earlier: where a signal
leaves the safety envelope, or the true roll its largest angle. The upper stop of roll is far above
a real rig's, so that it does not limit the height.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from heli3dof.model.compiled import compiled
from heli3dof.model.control.controller import N_OUT, control_law, parameters, state_at_rest
from heli3dof.model.physics import state_layout
from heli3dof.model.physics.integrator import fly_row
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.rig.envelope import Envelope
from heli3dof.rig.profile import default_profile

SPREAD = 0.2
"""share: thrust gain, T_g and the inertias lie uniformly within ±20 % of the profile's"""
MISMATCH = 0.05
"""largest share by which each motor's gain differs from the mean of both, uniform"""
LAG_S = 0.15
"""s: the rotors' lag lies uniformly between 0 and this"""
PITCH_STOP = math.radians(32.0)
"""rad, stops of pitch on the laboratory rig and on the emulated one"""
ROLL_STOP = math.radians(80.0)
"""rad, upper stop of roll: below the vertical, where the yaw inertia of the arm vanishes"""
SETTLE_S = 0.5
"""s of level hover before the step, the fault or the voltages"""
FALL_S = 4.0
"""s simulated after the trip"""
CLEAR = math.radians(0.5)
"""rad above the table: a trip below does not count, and another one is drawn"""
RATE = 9
"""index of the filtered rates in the controller's state"""
Pair = tuple[float, float]
PROFILE = default_profile().with_controller()
REST = float(PROFILE.encoder.rest_rad[0])


@dataclass(frozen=True)
class Situation:
    """The conditions of a flight until its trip."""

    name: str
    roll_deg: float = 0.0
    yaw_deg: float = 0.0
    level: bool = True
    """Starts in a level hover; otherwise on the table"""
    settle_s: float = SETTLE_S
    """s before the step, the frozen encoder or the voltages begin"""
    volts: Pair | None = None
    """Voltages of both motors after ``settle_s``, over v_max; None: the controller's voltages"""
    moment_s: Pair = (0.0, 1.5)
    """s from the end of ``settle_s`` to the trip: uniform between the two"""
    sign: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """signs of the encoders, as the host reads them"""
    frozen: int | None = None
    """axis whose encoder freezes"""
    wires: tuple[Pair, Pair] = ((1.0, 0.0), (0.0, 1.0))
    """matrix: the motors' voltages are it times the host's"""


def _saturated(name: str, volts: Pair, longest_s: float) -> Situation:
    return Situation(name, volts=volts, moment_s=(0.02, longest_s))


def _wrong_sign(axis: str, sign: tuple[float, float, float]) -> Situation:
    return Situation(
        f"{axis} encoder's sign wrong, roll 10°, yaw 20°", 10.0, 20.0, level=False, settle_s=0.0,
        moment_s=(4.0, 4.0), sign=sign,
    )  # fmt: skip


def _wrong_wires(name: str, wires: tuple[Pair, Pair]) -> Situation:
    return Situation(name, settle_s=0.0, moment_s=(0.05, 0.4), wires=wires)


SATURATED = (
    Situation(
        "take-off, both motors at +v_max", level=False, settle_s=0.0, volts=(1.0, 1.0),
        moment_s=(0.05, 0.3),
    ),
    _saturated("hover, then both at +v_max", (1.0, 1.0), 0.2),
    _saturated("hover, then both at −v_max", (-1.0, -1.0), 0.2),
    _saturated("hover, then front +v_max, back −v_max", (1.0, -1.0), 0.1),
    _saturated("hover, then front −v_max, back +v_max", (-1.0, 1.0), 0.1),
    _wrong_sign("roll", (-1.0, 1.0, 1.0)),
)  # fmt: skip
"""Situations with the voltages at their limit at the trip"""
HOVER = Situation("hover")
SITUATIONS = (
    HOVER,
    Situation("10° roll step", roll_deg=10.0),
    Situation("20° yaw step", yaw_deg=20.0),
    *SATURATED,
    _wrong_sign("pitch", (1.0, -1.0, 1.0)),
    _wrong_sign("yaw", (1.0, 1.0, -1.0)),
    _wrong_wires("hover, motors swapped", ((0.0, 1.0), (1.0, 0.0))),
    _wrong_wires("hover, front motor's wires swapped", ((-1.0, 0.0), (0.0, 1.0))),
    Situation("roll encoder freezes in a 10° roll step", 10.0, frozen=0, moment_s=(0.05, 0.8)),
    Situation("pitch encoder freezes in a 20° yaw step", 0.0, 20.0, frozen=1, moment_s=(0.05, 0.8)),
)


@dataclass(frozen=True)
class Rig:
    """The parameters of one drawn rig."""

    s: np.ndarray
    """the model's context, `heli3dof.model.physics.state_layout`"""
    wires: np.ndarray


@dataclass(frozen=True)
class Tripped:
    """A rig at its trip."""

    last: Pair
    """V, front and back, sent in the period before"""
    state: np.ndarray
    """(8,) angles (rad), rates (rad/s), thrusts (N)"""
    rig: Rig


@dataclass(frozen=True)
class Fall:
    """The motion after a trip."""

    climb_deg: float
    """highest roll minus the roll at the trip"""
    table_deg_per_s: float
    """roll's speed as the arm meets the table; if it bounces, the highest of these speeds"""
    pitch_deg: float
    """largest absolute pitch"""


def flights(situation: Situation, count: int, seed: int) -> Iterator[Tripped]:
    """Yields ``count`` trips in the air, each on a newly drawn rig."""
    rng = np.random.default_rng([seed, *situation.name.encode()])
    found = 0
    for _ in range(20 * count):
        if found == count:
            return
        tripped = _flight(situation, rng)
        if tripped is not None:
            found += 1
            yield tripped
    if found < count:
        raise RuntimeError(f"{situation.name}: {found} of {count} trips in the air")


def fall(tripped: Tripped, volts: np.ndarray) -> Fall:
    """Returns the motion under these voltages (n, 2) V, one row per period, zero after them."""
    dt = PROFILE.dt
    host = np.zeros((round(FALL_S / dt), 2))
    host[: len(volts)] = volts
    out = np.zeros(3)
    state, rig = tripped.state, tripped.rig
    _kernels()[1](rig.s.copy(), *_no_effects(), state.copy(), REST, PITCH_STOP, rig.wires, host,
                  dt, out)  # fmt: skip
    highest, table, pitch = np.degrees(out)
    return Fall(float(highest - math.degrees(state[0])), float(table), float(pitch))


def _flight(situation: Situation, rng: np.random.Generator) -> Tripped | None:
    dt, v_max = PROFILE.dt, PROFILE.motor.v_max
    settle = round(situation.settle_s / dt)
    N = settle + max(1, round(rng.uniform(*situation.moment_s) / dt)) + 1
    rig = Rig(_drawn(rng), np.array(situation.wires))
    reference = np.zeros((N, 3))
    reference[settle:, 0] = math.radians(situation.roll_deg)
    reference[settle:, 2] = math.radians(situation.yaw_deg)
    held = np.full((N, 2), np.nan)
    if situation.volts is not None:
        held[settle:] = np.multiply(situation.volts, v_max)
    state = np.zeros(8)
    if situation.level:
        state[6:] = rig.s[state_layout.T_G] / (2 * rig.s[state_layout.L_A])
    else:
        state[0] = REST
    assert PROFILE.controller is not None
    p = parameters(PROFILE.controller, PROFILE.motor.V_o, v_max, dt)
    c = state_at_rest(p, state[:3].tolist())
    frozen = np.full(3, N)
    if situation.frozen is not None:
        frozen[situation.frozen] = settle
    angle, rate, command = np.empty((N, 3)), np.empty((N, 3)), np.empty((N, 2))
    voltage, states = np.empty((N, 2)), np.empty((N, 8))
    _kernels()[0](
        rig.s, *_no_effects(), state, REST, PITCH_STOP, np.array(p), np.array(c), reference, held,
        rig.wires, np.array(situation.sign), frozen, dt, angle, rate, command, voltage, states,
    )  # fmt: skip
    k = N - 1
    above = np.flatnonzero(states[:, 0] > math.radians(PROFILE.limits.roll_max_deg))
    if len(above):
        k = int(above[0])
    if situation.volts is None:
        seen = zip(angle.tolist(), rate.tolist(), command.tolist(), voltage.tolist(), strict=True)
        envelope = Envelope(PROFILE)
        for i, (q, w, command_V, V) in enumerate(seen):
            if i >= k or envelope.check(i * dt, q, w, command_V, V) is not None:
                k = i
                break
    if k == 0 or states[k, 0] <= REST + CLEAR:
        return None
    return Tripped((float(voltage[k - 1, 0]), float(voltage[k - 1, 1])), states[k].copy(), rig)


def _drawn(rng: np.random.Generator) -> np.ndarray:
    structure = _structure()
    s, *_ = structure.arguments(structure.start)
    for slot in (state_layout.T_G, state_layout.J_R, state_layout.J_P, state_layout.J_PSI):
        s[slot] *= 1 + SPREAD * rng.uniform(-1, 1)
    s[state_layout.BODY_P], s[state_layout.BODY_PSI] = s[state_layout.J_P], s[state_layout.J_PSI]
    gain, half = 1 + SPREAD * rng.uniform(-1, 1), MISMATCH * rng.uniform(-1, 1)
    s[state_layout.GAIN_FRONT], s[state_layout.GAIN_BACK] = gain * (1 + half), gain * (1 - half)
    s[state_layout.TAU_M] = LAG_S * rng.uniform()
    return s


@cache
def _structure() -> Structure:
    return Structure(PROFILE, ())


def _no_effects() -> tuple[Any, ...]:
    """Returns the kernels' arguments first, address, par, mem, free for a model without effects."""
    structure = _structure()
    _, *effects = structure.arguments(structure.start)
    return (*effects, np.ones(3, dtype=bool))


def _move(s, first, address, par, mem, free, x, F, low, stop, V, k, t, h, target, w, decay):  # type: ignore[no-untyped-def]
    """Simulate one period; returns roll's speed (rad/s) at the table, 0 if it did not meet it."""
    fly_row(s, x, k, t, h, V, target, F, first, address, par, mem, free, w, decay)
    met = 0.0
    if x[0] < low:
        x[0] = low
        if x[3] < 0.0:
            met = -x[3]
            x[3] = 0.0
    if x[0] > ROLL_STOP:
        x[0] = ROLL_STOP
        x[3] = min(x[3], 0.0)
    if abs(x[1]) > stop:
        x[1] = math.copysign(stop, x[1])
        if x[1] * x[4] > 0.0:
            x[4] = 0.0
    return met


def _fly(  # type: ignore[no-untyped-def]
    s, first, address, par, mem, free, state, low, stop, p, c, reference, held, wires, sign,
    frozen, dt, angle, rate, command, voltage, states,
):  # fmt: skip
    N = reference.shape[0]
    w, decay, out, none = np.zeros((8, 3)), np.full(3, -1.0), np.empty(N_OUT), np.zeros(2)
    t, h = np.arange(N) * dt, np.full(N, dt)
    F, V, target = np.zeros((N, 2)), np.zeros((N, 2)), np.zeros((N, 2))
    x, start, y = state[:6].copy(), state[:6].copy(), np.empty(3)
    F[0, 0], F[0, 1] = state[6], state[7]
    for k in range(N):
        for i in range(6):
            states[k, i] = x[i]
        states[k, 6], states[k, 7] = F[k, 0], F[k, 1]
        for i in range(3):
            if k < frozen[i]:
                y[i] = start[i] + sign[i] * (x[i] - start[i])
            angle[k, i] = y[i]
        law(p, c, y, reference[k], none, out)
        for i in range(3):
            rate[k, i] = c[RATE + i]
        for i in range(2):
            command[k, i] = out[i]
            voltage[k, i] = out[2 + i] if np.isnan(held[k, i]) else held[k, i]
        for i in range(2):
            V[k, i] = wires[i, 0] * voltage[k, 0] + wires[i, 1] * voltage[k, 1]
        move(s, first, address, par, mem, free, x, F, low, stop, V, k, t, h, target, w, decay)


def _fall(s, first, address, par, mem, free, state, low, stop, wires, host, dt, out):  # type: ignore[no-untyped-def]
    N = host.shape[0]
    w, decay = np.zeros((8, 3)), np.full(3, -1.0)
    t, h = np.arange(N) * dt, np.full(N, dt)
    F, V, target = np.zeros((N, 2)), np.zeros((N, 2)), np.zeros((N, 2))
    x = state[:6].copy()
    F[0, 0], F[0, 1] = state[6], state[7]
    out[0] = x[0]
    for k in range(N):
        for i in range(2):
            V[k, i] = wires[i, 0] * host[k, 0] + wires[i, 1] * host[k, 1]
        met = move(s, first, address, par, mem, free, x, F, low, stop, V, k, t, h, target, w, decay)
        out[0] = max(out[0], x[0])
        out[1] = max(out[1], met)
        out[2] = max(out[2], abs(x[1]))


law = compiled(control_law, leaf=True)
move = compiled(_move, leaf=True, error_model="numpy")


@cache
def _kernels() -> tuple[Any, Any]:
    return compiled(_fly, error_model="numpy"), compiled(_fall, error_model="numpy")
