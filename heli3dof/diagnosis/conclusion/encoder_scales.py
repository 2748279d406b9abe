"""A wrong count per revolution is another cause as well, and no flight tells the two apart.

An encoder that reads y = rest + k (q − rest) for the angle q turns the rig into another one:

    yaw     ψ = y/k:  k L_a F cos r sin p = J_ψ ÿ              inertia.yaw, of 1/k
    pitch   the same with J_p, and the thrust is tilted by y/k:  inertia.pitch of 1/k, and of k on
            yaw, whose torque is −L_a F cos r sin p
    roll    the same with J_r, and level is read where
            q = rest (1 − 1/k):                                encoder.offset.roll, or a pendulum

What differs are products of rates and the next terms of sines. An inertia may lie anywhere within
the profile's tolerance ε, so with x = ln J/J_nominal and e = ln(1 + ε), a finding has an equal
where some ln k explains every inertia that it moves,

    yaw     ln k = −x_ψ
    pitch   |x_p + ln k| ≤ e   and   |x_ψ − ln k| ≤ e
    roll    1/k = 1 + δ/rest   and   |x_r + ln k| ≤ e         δ the offset, or asin(torque/T_g)

each within `SURE` standard deviations. Which of them it is, is seen by turning the axis by hand.

The same holds where nothing was found: a k of yaw or pitch that leaves the inertias within the
tolerance leaves nothing to find. So does one of roll where a level of rest (1 − 1/(1 + ε)) is not
seen.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from heli3dof.diagnosis.estimate.base_parameters import BaseParameter, OffNominal
from heli3dof.diagnosis.result import Finding
from heli3dof.model.effects import term

SURE = 2.0
EFFECT = "encoder.scale"
SCALE, WITH_MASS = "motor.thrust_gain", ("inertia.", "mass.imbalance")
"""What no flight separates from its equals: a wrong count; a scale, and all that has a mass"""
LEVEL = "encoder.offset.roll"
"""What a wrong count of roll looks like"""


def with_scale_ties(
    findings: Sequence[Finding], off: Sequence[OffNominal], numbers: Sequence[BaseParameter], *,
    rest_rad: float, tolerance: float,
) -> tuple[tuple[Finding, ...], tuple[OffNominal, ...]]:  # fmt: skip
    """The same, those with an equal tied with it. ``rest_rad``: the roll axis's."""
    x = {c.name: (c.x, c.told) for c in numbers}
    T_g = next((c.value for c in numbers if c.name == "T_g"), math.nan)
    equal = {f"inertia.{axis}": of for axis, of in _inertias(x, tolerance).items()}
    tilted = [
        f for f in findings
        if f.choice.term.name in ("encoder.offset.roll", "stiffness.pendulum.roll")
    ]  # fmt: skip
    for f in tilted:
        ln_k = _ln_k(_tilt(f, T_g), rest_rad)
        if _possible(ln_k) and _explains(x["J_roll"], -ln_k, tolerance):
            equal[f.choice.term.name] = (f"{EFFECT}.roll",)
            if x["J_roll"][0] * ln_k < 0:
                equal["inertia.roll"] = (f"{EFFECT}.roll",)
    return (
        tuple(_tied(f, equal.get(f.choice.term.name, ())) for f in findings),
        tuple(
            replace(o, tied_with=_joined(o.tied_with, equal.get(o.term.name, ()))) for o in off
        ),
    )  # fmt: skip


def undetectable_scales(
    tied: Sequence[str], axes: Sequence[str], *, rest_rad: float, tolerance: float,
    level_deg: float = math.inf,
) -> tuple[str, ...]:  # fmt: skip
    """The wrong counts that may be there and nothing says so, of the ``axes`` that were measured.

    ``tied``: what is told already, in a tie; ``level_deg``: the least `LEVEL` that is found.
    """
    seen = abs(math.degrees(rest_rad)) * (1 - 1 / (1 + tolerance)) > level_deg
    names = (f"{EFFECT}.{axis}" for axis in axes if axis != "roll" or not seen)
    return tuple(name for name in names if name not in tied)


def flyable(of: str, tied_with: Sequence[str]) -> tuple[str, ...]:
    """Those of the names ``of`` is tied with that some flight can separate.

    >>> flyable("inertia.roll", [SCALE, "encoder.scale.yaw"]), flyable("motor.dead_zone", [SCALE])
    ((), ('motor.thrust_gain',))
    """
    weighed = of.startswith(WITH_MASS)
    return tuple(n for n in tied_with if not n.startswith(EFFECT) and not (weighed and n == SCALE))


def _inertias(x: dict[str, tuple[float, float]], tolerance: float) -> dict[str, tuple[str, ...]]:
    """Axis → the equals of its inertia being off."""
    out: dict[str, list[str]] = {"pitch": [], "yaw": []}
    if _possible(-x["J_yaw"][0]):
        out["yaw"].append(f"{EFFECT}.yaw")
    # The ln k that is nearest to both, each by its own tolerance and noise.
    (p, s_p), (y, s_y) = x["J_pitch"], x["J_yaw"]
    ln_k = (y - p) / 2
    if (
        _possible(ln_k)
        and _explains((p, s_p), -ln_k, tolerance)
        and _explains((y, s_y), ln_k, tolerance)
    ):
        out["pitch"].append(f"{EFFECT}.pitch")
        out["yaw"].append(f"{EFFECT}.pitch")
    return {axis: tuple(names) for axis, names in out.items()}


def _explains(x: tuple[float, float], by: float, tolerance: float) -> bool:
    """Whether an inertia within its tolerance, seen at x ± σ, may be one that is moved by that."""
    value, std = x
    return abs(value - by) <= math.log1p(tolerance) + SURE * std


def _tilt(f: Finding, T_g: float) -> float:
    """rad that the level reading is off; NaN where no tilt is as strong."""
    value = next(iter(f.values.values()))[0]
    if f.choice.term.effect.name == "encoder.offset":
        return math.radians(value)
    return math.asin(value / T_g) if abs(value) < T_g else math.nan


def _ln_k(tilt: float, rest_rad: float) -> float:
    inverse = 1 + tilt / rest_rad if rest_rad else math.nan
    return -math.log(inverse) if inverse > 0 else math.nan


def _possible(ln_k: float) -> bool:
    k = term(f"{EFFECT}.yaw").effect.parameters[0]
    return bool(np.isfinite(ln_k)) and k.low <= math.exp(ln_k) <= k.high


def _tied(f: Finding, more: Sequence[str]) -> Finding:
    return replace(f, choice=replace(f.choice, tied_with=_joined(f.choice.tied_with, more)))


def _joined(names: Sequence[str], more: Sequence[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys((*names, *more)))
