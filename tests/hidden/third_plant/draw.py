"""Flights with hidden effects: the rig, plan and loop that a seed draws, and the effects' sizes.

Draws (uniform unless another distribution is given)::

    masses, K_f, T_g   ± 7 % of the profile's; J within ± 7 %, hover at 3.6–4.5 V
    loop               100, 200, 500 or 1000 Hz; rounded counts, half a count, integrals first
    noise              correlated over 0.01–0.5 s (log-uniform)
    references         run-step: 10° of roll at 2 s; else steps of 10–20° on each axis, 8–10 s apart
    added voltages     rich only: 20 sines per motor, 0.08 to 4–8 Hz, 0.8–1.2 V RMS
    start              at trim, or after 10 s of flight (30 %)

An effect's signal ratio on axis i compares predictions 1 s ahead, with y of the rig, ŷ without the
effect, and n_i the prediction error of the rig without any, due to noise and quantisation::

    ρ_i = RMS(y_i − ŷ_i(θ̂)) / n_i,   θ̂ = argmin Σ_i ((y_i − ŷ_i(θ)) / n_i)²

θ are K_f, T_g and the inertias, each within ± 15 % of the profile's. A size is sought at which ρ on
the effect's axis (for encoders, and without an axis: the largest ρ_i) is a log-uniform draw from
`TARGET`. Effects on θ itself have no θ̂ and a drawn size beyond 15 %.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.optimize import lsq_linear

from heli3dof.recording.recording import Recording, recording_of_arrays
from heli3dof.rig.profile import Profile, profile_from_dict
from tests.hidden.third_plant import body
from tests.hidden.third_plant.effects import AXES, CHEESEMAN_BENNETT, EFFECTS, Effect, nominal
from tests.hidden.third_plant.loop import (
    COUNTS,
    STEP_RAD,
    V_MAX,
    Log,
    Loop,
    Task,
    fly,
    predicted,
    random_torques,
)

TARGET = (3.3, 13.5)
WEAK = 2.0
"""Signal ratio below which no diagnosis has to find an effect"""
SPREAD, TOLERANCE = 0.07, 0.15
PITCH_TRIM_NM = 1.5e-4
"""Largest torque of unequal motors"""
HOLDOUT_S, LEAD_S = 40.0, 10.0
BARE_DEG, HIDDEN_DEG = 28.0, 33.0
"""Largest pitch of a flight without and with effects; `_inside` has the other bounds"""
ATTEMPTS = 6


@dataclass(frozen=True)
class Hidden:
    """An effect with its drawn sign and further fields of the rig, its size and signal ratio."""

    effect: Effect
    sign: float
    more: dict[str, float] = field(default_factory=dict)
    size: float = math.nan
    ratio: float = math.nan

    @property
    def value(self) -> float:
        """The contract's parameter, in its unit."""
        return self.effect.value(self.size, self.sign)

    def put(self, rig: Any) -> None:
        self.effect.hide(rig, self.value)
        for name, value in self.more.items():
            self.effect.write(rig, name, value)


@dataclass(frozen=True)
class Flights:
    """The two recordings that a diagnosis gets, and what is hidden in them."""

    log: Recording
    holdout: Recording
    hidden: tuple[Hidden, ...]


def draw_flights(
    names: Sequence[str], plan: str, known: bool, seed: Sequence[int]
) -> Flights | str:
    """The flights of a seed, or why there are none. ``known``: the profile has the controller."""
    for attempt in range(ATTEMPTS):
        flights = _attempt(names, plan, known, np.random.default_rng([*seed, attempt]))
        if flights:
            return flights
    return f"no flight of {', '.join(names) or 'the rig'} stays within the bounds"


def _attempt(
    names: Sequence[str], plan: str, known: bool, rng: np.random.Generator
) -> Flights | None:
    rate_hz = int(rng.choice((100, 200, 500, 1000), p=(0.12, 0.13, 0.63, 0.12)))
    rounds = rng.random() < 0.4
    loop = Loop(rate_hz, rounds, not rounds and rng.random() < 0.4, rng.random() < 0.5)
    rig, tau_c = draw_rig(rng), log_uniform(rng, 0.01, 0.5)
    lead = int(LEAD_S * rate_hz) if rng.random() < 0.3 else 0
    duration = float(rng.choice((20.0, 60.0))) if plan == "run-step" else 60.0
    tasks = (draw_task(plan, s, loop, lead, tau_c, rng) for s in (duration, HOLDOUT_S))
    task, held = (_inside(loop, t, rig, BARE_DEG, 0.85) for t in tasks)
    if not task or not held:
        return None
    bench = Bench(loop, task[0], rig, _noise_rad(loop, *task, rig))
    hidden = [choose(name, duration, rng) for name in names]
    for j in range(len(hidden)):
        sized = bench.sized(hidden, j, log_uniform(rng, *TARGET), rng)
        if not sized:
            return None
        hidden[j] = sized
    other_phase = [
        replace(h, more={**h.more, "periodic_rad": rng.uniform(0, 2 * np.pi)})
        if "periodic_rad" in h.more else h
        for h in hidden
    ]  # fmt: skip
    flown = _inside(loop, task[0], bench.rig_with(hidden), HIDDEN_DEG, 0.9)
    other = _inside(loop, held[0], bench.rig_with(other_phase), HIDDEN_DEG, 0.9)
    if not flown or not other:
        return None
    bench = replace(bench, task=flown[0])
    ratios = [bench.ratio(flown[1], hidden, j) for j in range(len(hidden))]
    commands = rng.random() < 0.1
    log, holdout = (_recording(loop, *f, known, commands) for f in (flown, other))
    return Flights(
        log, holdout, tuple(replace(h, ratio=r) for h, r in zip(hidden, ratios, strict=True))
    )


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(math.log(low), math.log(high))))


def draw_rig(rng: np.random.Generator) -> Any:
    """The record of a rig; the counterweight's arm L_w gives the drawn T_g."""
    while True:
        rig = nominal()
        T_g, J = body.trim_torque(rig), body.inertias(rig)
        K_f, m_w, both, trim = rng.uniform(1 - SPREAD, 1 + SPREAD, 4)
        unequal = rng.uniform(-1, 1) * PITCH_TRIM_NM / (body.GRAVITY * rig["L_h"])
        rig["K_f"] *= K_f
        rig["m_w"] *= m_w
        rig["m_f"], rig["m_b"] = rig["m_f"] * both + unequal / 2, rig["m_b"] * both - unequal / 2
        at_end = rig["L_a"] * (rig["m_f"] + rig["m_b"])
        rig["L_w"] = (at_end - T_g * trim / body.GRAVITY) / rig["m_w"]
        hover_V = T_g * trim / (2 * rig["L_a"] * rig["K_f"])
        if np.all(abs(body.inertias(rig) / J - 1) < SPREAD) and 3.6 < hover_V < 4.5:
            return rig


def draw_task(
    plan: str, duration_s: float, loop: Loop, lead: int, tau_c: float, rng: np.random.Generator
) -> Task:
    """The references, added voltages and random torques of a flight."""
    n = round(duration_s * loop.rate_hz)
    t = np.arange(n) / loop.rate_hz
    reference, extra = np.zeros((n, 3)), np.zeros((n, 2))
    if plan == "run-step":
        reference[t >= 2.0 - 1e-9, 0] = math.radians(10.0)
    else:
        for axis in range(3):
            at = rng.uniform(1.0, 3.0) + 2.7 * rng.integers(3)
            level = 0.0
            while at < duration_s:
                change = rng.choice((-1, 1)) * rng.uniform(10, 20)
                level += change if abs(level + change) <= 20 else -change
                level = min(max(level, -20.0), 20.0)
                reference[t >= at, axis] = math.radians(level)
                at += rng.uniform(8, 10)
    if plan == "rich":
        f = np.geomspace(0.08, rng.uniform(4, 8), 40) * np.exp(rng.uniform(-0.03, 0.03, 40))
        rms, f = rng.uniform(0.8, 1.2), rng.permutation(f)
        for motor in range(2):
            phase = 2 * np.pi * np.outer(t, f[motor::2]) + rng.uniform(0, 2 * np.pi, 20)
            extra[:, motor] = np.sin(phase).sum(axis=1) * rms / math.sqrt(10)
    before = ((lead, 0), (0, 0))
    noise = random_torques(rng, (n + lead) * loop.substeps, loop.dt, tau_c)
    return Task(np.pad(reference, before), np.pad(extra, before), noise, lead)


def _inside(
    loop: Loop, task: Task, rig: Any, pitch_deg: float, factor: float
) -> tuple[Task, Log] | None:
    """The flight within the bounds, its references scaled down as often as needed."""
    for _ in range(10):
        log = fly(loop, task, rig)
        if log and _within(log, task, pitch_deg):
            return task, log
        task = task.scaled(factor)
    return None


def _within(log: Log, task: Task, pitch_deg: float) -> bool:
    roll, pitch, yaw = np.degrees(log.state[task.lead :, :3]).T
    return bool(
        roll.min() > -26.5 and roll.max() < 35 and abs(pitch).max() < pitch_deg
        and abs(yaw).max() < 120
    )  # fmt: skip


def _noise_rad(loop: Loop, task: Task, log: Log, rig: Any) -> np.ndarray:
    """n (3,) in rad."""
    starts, angles = predicted(loop, task, log, rig, log.state, log.seen)
    half = 0.0 if loop.rounds else 0.5
    error = log.reading[starts + loop.rate_hz] + half * STEP_RAD - angles
    return np.asarray(np.sqrt(np.mean(error**2, axis=0)))


def choose(name: str, duration_s: float, rng: np.random.Generator) -> Hidden:
    """The effect with its sign and further fields drawn, still without a size."""
    effect, more = EFFECTS[name], {}
    if name.startswith("disturbance.periodic"):
        more = {"periodic_Hz": log_uniform(rng, 0.3, 4.0), "periodic_rad": rng.uniform(0, 6.28)}
    elif name == "mass.change":
        more = {"weight_at_s": rng.uniform(0.3, 0.6) * min(duration_s, HOLDOUT_S)}
    elif name == "aero.reaction_torque":
        more = {"reaction_back": -1.0 if rng.random() < 0.35 else 1.0}
    elif name == "aero.ground_effect" and rng.random() < 0.5:
        effect = CHEESEMAN_BENNETT
    elif name == "aero.ground_effect":
        more = {"ground_length_m": log_uniform(rng, 0.08, 0.2)}
    return Hidden(effect, float(rng.choice((-1.0, 1.0))), more)


@dataclass(frozen=True)
class Bench:
    """A rig without effects on its loop and task; ``noise_rad`` is n."""

    loop: Loop
    task: Task
    rig: Any
    noise_rad: np.ndarray

    def rig_with(self, hidden: Sequence[Hidden]) -> Any:
        """The rig with those effects that have a size."""
        rig = self.rig.copy()
        for h in hidden:
            if not math.isnan(h.size):
                h.put(rig)
        return rig

    def sized(
        self, hidden: Sequence[Hidden], which: int, target: float, rng: np.random.Generator
    ) -> Hidden | None:
        """The effect at the size whose ratio is nearest to the target; None: nothing flies.

        A search in ln s: ρ grows about as s, and the interval halves where it does not.
        """
        h = hidden[which]
        if not h.effect.sized:
            return replace(h, size=log_uniform(rng, h.effect.low, h.effect.high))
        bottom, top = math.log(h.effect.low), math.log(h.effect.high)
        low, high, at, best = -math.inf, math.inf, 0.5 * (bottom + top), None
        for _ in range(9):
            tried = replace(h, size=math.exp(at))
            others = [*hidden[:which], tried, *hidden[which + 1 :]]
            log = fly(self.loop, self.task, self.rig_with(others))
            guess = math.nan
            if not log or not _within(log, self.task, HIDDEN_DEG):
                high = at
            else:
                ratio = max(self.ratio(log, others, which), 1e-3 * target)
                if not best or abs(math.log(ratio / target)) < abs(math.log(best.ratio / target)):
                    best = replace(tried, ratio=ratio)
                if 0.8 < ratio / target < 1.25:
                    break
                low, high = (at, high) if ratio < target else (low, at)
                guess = min(max(at + math.log(target / ratio), bottom), top)
            if low >= top or high <= bottom:
                break
            at = guess if low < guess < high else 0.5 * (max(low, bottom) + min(high, top))
        return best

    def ratio(self, log: Log, hidden: Sequence[Hidden], which: int) -> float:
        """The signal ratio ρ of one of the hidden effects."""
        effect, rig, axis = hidden[which].effect, self.rig_with(hidden), hidden[which].effect.axis
        without = self.rig_with([*hidden[:which], *hidden[which + 1 :]])
        is_encoder = effect.name.startswith("encoder.")
        state, seen = log.state, log.seen
        if is_encoder and axis is not None:  # without the effect, its reading is the angle
            state, seen = state.copy(), seen.copy()
            seen[:, axis] = seen[:, axis] * rig["scale"][axis] + rig["offset_rad"][axis]
            state[:, axis] = seen[:, axis]
            state[:, 3 + axis] *= rig["scale"][axis]

        def angles(rig: Any) -> np.ndarray:
            ahead = predicted(self.loop, self.task, log, rig, state, seen)[1]
            return np.asarray(ahead / self.noise_rad)

        expected = angles(without)
        starts, given = predicted(self.loop, self.task, log, rig, log.state, log.seen)
        error = given / self.noise_rad - expected
        if effect.sized:
            error -= _explained(error, expected, without, angles)
        t = (starts - self.task.lead) / self.loop.rate_hz
        error = error[t >= hidden[which].more.get("weight_at_s", 0.0)]
        ratios = np.sqrt(np.mean(error**2, axis=0))
        return float(ratios.max() if is_encoder or axis is None else ratios[axis])


def _explained(error: np.ndarray, expected: np.ndarray, rig: Any, angles: Any) -> np.ndarray:
    """The part of the error (n, 3) that a linear fit of θ explains."""
    reference, columns = nominal(), []
    J = np.diag(body.inertias(reference))
    θ = (("K_f", reference["K_f"]), ("imbalance", body.trim_torque(reference)),
         *(("added_inertia", row) for row in J))  # fmt: skip
    for name, amount in θ:
        changed = rig.copy()
        changed[name] = changed[name] + 0.02 * amount
        columns.append((angles(changed) - expected).ravel())
    most = TOLERANCE / 0.02
    fitted = lsq_linear(np.column_stack(columns), error.ravel(), (-most, most))
    return np.reshape(np.column_stack(columns) @ fitted.x, error.shape)


def profile(loop: Loop, known: bool) -> Profile:
    """The profile that the diagnosis gets: the nominal rig."""
    rig = nominal()
    data: dict[str, Any] = {
        "name": "bench",
        "geometry": {name: float(rig[name]) for name in ("L_w", "L_a", "L_h")},
        "mass": {name: float(rig[name]) for name in ("m_w", "m_f", "m_b")},
        "motor": {"K_f": float(rig["K_f"]), "V_o": float(rig["V_o"]), "v_max": V_MAX},
        "encoder": dict(zip(AXES, COUNTS, strict=True)),
        "loop": {"rate_hz": float(loop.rate_hz)},
    }
    return profile_from_dict(data | ({"controller": {}} if known else {}))


def _recording(loop: Loop, task: Task, log: Log, known: bool, commands: bool) -> Recording:
    k = task.lead
    return recording_of_arrays(
        np.arange(len(log.voltage) - k) / loop.rate_hz, log.voltage[k:], log.reading[k:],
        profile(loop, known),
        reference=task.reference[k:] if known else None,
        voltage_cmd=log.command[k:] if commands else None,
        voltage_extra=task.extra[k:] if known else None,
        meta={"name": "flight", "source": "import"},
    )  # fmt: skip
