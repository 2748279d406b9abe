"""Compares ramps to zero volts after a trip: climb of the arm, and its speed at the table."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence

import numpy as np

from heli3dof.experiment.control_loop.ramp_down import HOVER_BAND, ramp_start
from tests.bench import Figure, Table, at_least
from tests.bench.emulated_trips import tripped
from tests.bench.simulated_trips import (
    HOVER,
    PROFILE,
    SATURATED,
    SITUATIONS,
    Fall,
    Pair,
    Situation,
    fall,
    flights,
)

RIGS = int(os.environ.get("RAMP_DOWN_RIGS", "200"))
"""Number of flights, for each situation on the model, and in all on the emulator"""
TITLE = "The ramp to zero volts after a trip"
INTRO = f"""
{RIGS} flights of each situation on the profile's rigid body: thrust gain, T_g and inertias drawn
within ±20 %, front and back motor within ±5 % of each other's mean, rotor lag 0 to 0.15 s. Then
{RIGS} flights at saturation and {RIGS} in hover on the emulated rig, an independent plant. Seeds
1, 2, … The laws, with c the mean of both motors' last voltages, all over `ramp_down_s` = 0.5 s:

- *zero*: both motors to zero at once
- *V_last*: ramp from the last voltages
- *min*: ramp from c limited to 0 … V_o, both motors alike
- *reflected*: ramp from V_last scaled so that the larger motor starts at V_o − |V − V_o|; zero at
  once where that, or a motor's voltage, is negative
- *band q*: ramp from V_last where both motors are within q V_h of V_o, zero at once elsewhere; V_h
  is max(|V_o|, v_max/8). **band ½** is the law in use
- *host dead*: the device's watchdog: V_last for 0.1 s more, then a ramp of 0.2 s
"""
V_O, HOVER_V = PROFILE.motor.V_o, PROFILE.motor.hover_V
EQUAL_DEG = 0.1
"""°: climbs that differ by at most this, about one encoder count, are equal"""
SEED = 1
LEAST_SHARE = 95.0
"""%: required share of flights that climb no higher than with zero at once"""
Law = Callable[[Pair], np.ndarray]


def ramp(start: Pair, seconds: float = PROFILE.limits.ramp_down_s) -> np.ndarray:
    n = round(seconds / PROFILE.dt)
    return np.outer(1 - np.arange(1, n + 1) / n, start)


def from_at_most_hover(last: Pair) -> np.ndarray:
    common = min(max(sum(last) / 2, 0.0), V_O)
    return ramp((common, common))


def reflected(last: Pair) -> np.ndarray:
    most = max(last)
    if min(last) < 0 or most <= 0:
        return ramp((0.0, 0.0))
    share = max(0.0, V_O - abs(most - V_O)) / most
    return ramp((share * last[0], share * last[1]))


def within(band: float) -> Law:
    def law(last: Pair) -> np.ndarray:
        near = all(abs(volts - V_O) <= band * HOVER_V for volts in last)
        return ramp(last if near else (0.0, 0.0))

    return law


def flown(last: Pair) -> np.ndarray:
    return ramp(ramp_start(last, PROFILE.motor))


def flown_without_difference(last: Pair) -> np.ndarray:
    start = sum(ramp_start(last, PROFILE.motor)) / 2
    return ramp((start, start))


def host_dead(last: Pair) -> np.ndarray:
    return np.vstack([np.tile(last, (round(0.1 / PROFILE.dt), 1)), ramp(last, 0.2)])


LAWS: dict[str, Law] = {
    "zero": lambda last: ramp((0.0, 0.0)),
    "V_last": ramp,
    "min": from_at_most_hover,
    "reflected": reflected,
    "band ¼": within(0.25),
    "**band ½**": flown,
    "band 1": within(1.0),
    "host dead": host_dead,
}
CLIMB = "Highest roll beyond that at the trip, °, median / worst"
SPEED = "Roll's speed at the table, °/s, median / worst"


def measure() -> list[Figure | Table]:
    climb, speed = [], []
    for situation in SITUATIONS:
        trips = list(flights(situation, RIGS, SEED))
        falls = [[fall(trip, law(trip.last)) for trip in trips] for law in LAWS.values()]
        climb.append((situation.name, *(_pair([f.climb_deg for f in fs], 1) for fs in falls)))
        speed.append((situation.name, *(_pair([f.table_deg_per_s for f in fs]) for fs in falls)))
    head = ("tripped in", *LAWS)
    return [
        Table(CLIMB, head, tuple(climb)),
        Table(SPEED, head, tuple(speed)),
        *_difference(),
        *_emulated(),
    ]


def _difference() -> list[Figure]:
    trips = list(flights(HOVER, RIGS, SEED))
    kept = [fall(trip, flown(trip.last)).pitch_deg for trip in trips]
    removed = [fall(trip, flown_without_difference(trip.last)).pitch_deg for trip in trips]
    how = "model; median / worst"
    return [
        Figure(
            "hover: largest pitch, difference of the motors ramped", f"{_pair(kept)} °", how=how
        ),
        Figure("hover: largest pitch, difference removed at once", f"{_pair(removed)} °", how=how),
    ]


def _emulated() -> list[Figure | Table]:
    bands = {"zero": -1.0, "V_last": math.inf, "**band ½**": HOVER_BAND}
    rows: list[tuple[str, ...]] = []
    pooled: dict[str, list[Fall]] = {name: [] for name in bands}
    share = math.ceil(RIGS / len(SATURATED))
    for i, situation in enumerate(SATURATED):
        count = min(share, RIGS - i * share)
        result = {name: _tripped(situation, count, band) for name, band in bands.items()}
        for name, falls in result.items():
            pooled[name] += falls
        rows.append(_row(situation.name, list(result.values())))
    rows.append(_row(f"all {RIGS}", list(pooled.values())))
    hovering = {name: _tripped(HOVER, RIGS, band) for name, band in bands.items()}
    rows.append(_row(HOVER.name, list(hovering.values())))
    no_worse = [
        now.climb_deg <= zero.climb_deg + EQUAL_DEG
        for now, zero in zip(pooled["**band ½**"], pooled["zero"], strict=True)
    ]
    ramped = [
        now == before
        for now, before in zip(hovering["**band ½**"], hovering["V_last"], strict=True)
    ]
    head = ("emulated, tripped in", *(f"{what}, {name}" for name in bands for what in ("°", "°/s")))
    return [
        Table(f"Independent plant; {CLIMB}; {SPEED}", head, tuple(rows)),
        at_least(
            "saturated: flights that climb no higher than with zero at once",
            100 * float(np.mean(no_worse)), LEAST_SHARE, "%", how=f"{len(no_worse)} emulated rigs",
        ),
        at_least(
            "hover: flights ramped from V_last",
            100 * float(np.mean(ramped)), LEAST_SHARE, "%", how=f"{len(ramped)} emulated rigs",
        ),
    ]  # fmt: skip


def _tripped(situation: Situation, count: int, band: float) -> list[Fall]:
    """Returns ``count`` trips in the air; ``band`` (the law after it) does not affect which."""
    falls: list[Fall] = []
    seed = 0
    while len(falls) < count and seed < 20 * count:
        seed += 1
        result = tripped(situation, seed, band)
        if result is not None:
            falls.append(result)
    return falls


def _row(name: str, laws: list[list[Fall]]) -> tuple[str, ...]:
    cells = [name]
    for falls in laws:
        cells += [_pair([f.climb_deg for f in falls], 1), _pair([f.table_deg_per_s for f in falls])]
    return tuple(cells)


def _pair(values: Sequence[float], digits: int = 0) -> str:
    return f"{np.median(values):.{digits}f} / {max(values):.{digits}f}"
