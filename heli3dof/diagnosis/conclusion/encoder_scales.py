"""Report causes that are confounded with a wrong encoder scale (counts per revolution).

An encoder with scale error k reads y = rest + k (q − rest) at the angle q. rest is the angle at
which counts start. A flight with this error looks like a flight without it, but with other inertias
J. With roll r, pitch p, yaw ψ, arm length L_a and thrust F:

    yaw     ψ = y/k:  k L_a F cos r sin p = J_ψ ÿ, so an inertia J_ψ/k
    pitch   an inertia J_p/k; sin p ≈ y/k drives yaw, so also an inertia k J_ψ
    roll    an inertia J_r/k; y = 0 at q = rest (1 − 1/k), so an offset or a pendulum torque

The two flights differ only in products of rates and in higher-order terms of the sines.

Let x = ln(J/J_nominal) for a fitted inertia J, σ the standard deviation of x, ε the profile's
tolerance and e = ln(1 + ε) + `SIGMAS_95` σ. δ is the roll offset found, or asin(τ/T_g) for a
pendulum torque τ and the trim torque T_g. A finding is confounded with the scale error of an axis
if k is within the bounds of the effect ``encoder.scale`` and meets the conditions in the row of the
axis:

    yaw     ln k = −x_ψ
    pitch   ln k = (x_ψ − x_p)/2,   |x_p + ln k| ≤ e_p   and   |x_ψ − ln k| ≤ e_ψ
    roll    1/k = 1 + δ/rest   and   |x_r + ln k| ≤ e_r

If there is no such finding, the recordings cannot show a scale error of yaw or pitch within the
tolerance. They show one of roll if the roll offset rest (1 − 1/(1 + ε)) is detectable.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.base_parameters import THRUST_GAIN, BaseParameter, OffNominal
from heli3dof.diagnosis.constants import SIGMAS_95
from heli3dof.diagnosis.result import Finding
from heli3dof.diagnosis.selection.select import with_ties
from heli3dof.model.effects import term

EFFECT = "encoder.scale"
WITH_MASS = ("inertia.", "mass.imbalance")
"""Base parameters that no flight separates from the thrust gain"""
ROLL_OFFSET = "encoder.offset.roll"
"""The cause with which a scale error of roll is confounded"""


def with_scale_ties(
    findings: Sequence[Finding], off: Sequence[OffNominal], numbers: Sequence[BaseParameter], *,
    rest_rad: float, tolerance: float,
) -> tuple[tuple[Finding, ...], tuple[OffNominal, ...]]:  # fmt: skip
    """Return ``findings`` and ``off``; their ``tied_with`` also names confounded encoder scales.

    ``off``: base parameters off nominal; ``numbers``: estimates of all base parameters;
    ``rest_rad``: roll at rest on the table; ``tolerance``: the profile's.
    """
    x = {c.name: (c.x, c.noise_std) for c in numbers}
    T_g = next((c.value for c in numbers if c.name == "T_g"), math.nan)
    ties = {f"inertia.{axis}": of for axis, of in _inertia_ties(x, tolerance).items()}
    roll_findings = [
        f for f in findings
        if f.term.name in ("encoder.offset.roll", "stiffness.pendulum.roll")
    ]  # fmt: skip
    for f in roll_findings:
        ln_k = _ln_k(_zero_error(f, T_g), rest_rad)
        if _is_possible(ln_k) and _is_consistent(x["J_roll"], -ln_k, tolerance):
            ties[f.term.name] = (f"{EFFECT}.roll",)
            if x["J_roll"][0] * ln_k < 0:
                ties["inertia.roll"] = (f"{EFFECT}.roll",)
    tied = (replace(f, choice=with_ties(f.choice, ties.get(f.term.name, ()))) for f in findings)
    return tuple(tied), tuple(with_ties(o, ties.get(o.term.name, ())) for o in off)


def undetectable_scales(
    tied: Sequence[str], axes: Sequence[str], *, rest_rad: float, tolerance: float,
    detectable_offset_deg: float = math.inf,
) -> tuple[str, ...]:  # fmt: skip
    """Return the encoder scale errors of the measured ``axes`` that the recordings cannot show.

    A wrong roll scale also shifts the level angle, because counts start at the rest angle
    ``rest_rad``. ``detectable_offset_deg``: least detectable shift. ``tolerance``: relative scale
    error that must be detectable. ``tied``: scale errors to omit, as they are already reported.
    """
    detectable = abs(math.degrees(rest_rad)) * (1 - 1 / (1 + tolerance)) > detectable_offset_deg
    names = (f"{EFFECT}.{axis}" for axis in axes if axis != "roll" or not detectable)
    return tuple(name for name in names if name not in tied)


def separable_by_flight(of: str, tied_with: Sequence[str]) -> tuple[str, ...]:
    """Return the causes in ``tied_with`` that a flight can separate from the cause ``of``.

    No flight separates an encoder scale, or the thrust gain from an inertia or imbalance.

    >>> separable_by_flight("inertia.roll", [THRUST_GAIN, "encoder.scale.yaw"])
    ()
    >>> separable_by_flight("motor.dead_zone", [THRUST_GAIN])
    ('motor.thrust_gain',)
    >>> separable_by_flight(THRUST_GAIN, ["inertia.roll"])
    ()
    """

    def is_scale_of_mass(a: str, b: str) -> bool:
        return a == THRUST_GAIN and b.startswith(WITH_MASS)

    return tuple(
        n
        for n in tied_with
        if not (n.startswith(EFFECT) or is_scale_of_mass(n, of) or is_scale_of_mass(of, n))
    )


def with_thrust_gain_ties(off: Sequence[OffNominal]) -> tuple[OffNominal, ...]:
    """Return ``off``, with further confounded causes if the thrust gain K_f is off nominal.

    K_f is then confounded with the inertias, and every other base parameter off nominal with K_f.
    Without simulated flights, only the profile's nominal values separate a wrong K_f from inertias
    that are all wrong by the inverse factor (`greybox.thrust_scale`).
    """
    if not any(o.term.name == THRUST_GAIN for o in off):
        return tuple(off)
    inertias = tuple(f"inertia.{axis}" for axis in AXES)

    def others(o: OffNominal) -> tuple[str, ...]:
        return inertias if o.term.name == THRUST_GAIN else (THRUST_GAIN,)

    return tuple(with_ties(o, others(o)) for o in off)


def _inertia_ties(
    x: dict[str, tuple[float, float]], tolerance: float
) -> dict[str, tuple[str, ...]]:
    """Return {axis: scale errors confounded with a wrong inertia of this axis}.

    ``x``: {name of the inertia J: (ln(J/J_nominal), its standard deviation)}.
    """
    out: dict[str, list[str]] = {"pitch": [], "yaw": []}
    if _is_possible(-x["J_yaw"][0]):
        out["yaw"].append(f"{EFFECT}.yaw")
    # Midway between −x_p and x_ψ, the values of ln k by pitch and yaw.
    (p, s_p), (y, s_y) = x["J_pitch"], x["J_yaw"]
    ln_k = (y - p) / 2
    if (
        _is_possible(ln_k)
        and _is_consistent((p, s_p), -ln_k, tolerance)
        and _is_consistent((y, s_y), ln_k, tolerance)
    ):
        out["pitch"].append(f"{EFFECT}.pitch")
        out["yaw"].append(f"{EFFECT}.pitch")
    return {axis: tuple(names) for axis, names in out.items()}


def _is_consistent(x: tuple[float, float], shift: float, tolerance: float) -> bool:
    """Return whether J/J_nominal of an inertia J is exp(``shift``), within tolerance and noise.

    x: (ln(J/J_nominal), its standard deviation σ). The difference between ln(J/J_nominal) and
    ``shift`` may be ln(1 + ``tolerance``) + `SIGMAS_95` σ.
    """
    value, std = x
    return abs(value - shift) <= math.log1p(tolerance) + SIGMAS_95 * std


def _zero_error(f: Finding, T_g: float) -> float:
    """Return the roll offset (rad) equivalent to a finding; NaN if there is no such offset.

    The finding is an encoder offset of roll or a pendulum torque. ``T_g``: gravity torque of the
    level arm, N·m.
    """
    value = next(iter(f.values.values()))[0]
    if f.term.effect.name == "encoder.offset":
        return math.radians(value)
    return math.asin(value / T_g) if abs(value) < T_g else math.nan


def _ln_k(zero_error: float, rest_rad: float) -> float:
    inverse = 1 + zero_error / rest_rad if rest_rad else math.nan
    return -math.log(inverse) if inverse > 0 else math.nan


def _is_possible(ln_k: float) -> bool:
    k = term(f"{EFFECT}.yaw").effect.parameters[0]
    return bool(np.isfinite(ln_k)) and k.low <= math.exp(ln_k) <= k.high
