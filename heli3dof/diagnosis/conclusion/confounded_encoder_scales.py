"""Find out which causes are confounded with a scale error of an encoder.

An encoder with the scale error k has the reading y = rest + k (q − rest) at the angle q. rest is
the angle of the rig on the table, where counts start. A rig with a correct encoder and other
inertias has nearly the same readings. The model has correct encoders, so the fit finds these other
inertias. The rig has the roll angle r, pitch p, yaw ψ, arm length L_a, thrust F and inertias J:

    axis    fitted inertias                   because
    yaw     J_ψ/k in place of J_ψ             ψ = y/k, so that k L_a F cos r sin p = J_ψ ÿ
    pitch   J_p/k in place of J_p,            p = y/k;
            k J_ψ in place of J_ψ             yaw is driven by sin p ≈ y/k
    roll    J_r/k in place of J_r             r = rest + (y − rest)/k

The readings of the two rigs differ only by products of rates and by higher-order terms of the
sines. A scale error of roll also shifts the level angle: y = 0 at q = rest (1 − 1/k). The fit
attributes this shift to an encoder offset or to a pendulum torque (an offset centre of mass).

So the true cause of three kinds of findings may be a scale error:

- an inertia off nominal
- an encoder offset δ of roll
- a pendulum torque −τ sin r of roll, equivalent to the offset δ = asin(τ/T_g)

For a fitted inertia J, x = ln(J/J_nominal) has the standard deviation σ. ε is the profile's
tolerance, and e = ln(1 + ε) + `SIGMAS_95` σ. For each axis, the following equation gives the k that
explains the findings. The scale error is confounded with them if the inequalities hold, and if k is
within the bounds of the effect ``encoder.scale``:

    yaw     ln k = −x_ψ
    pitch   ln k = (x_ψ − x_p)/2,   |x_p + ln k| ≤ e_p   and   |x_ψ − ln k| ≤ e_ψ
    roll    1/k = 1 + δ/rest,       |x_r + ln k| ≤ e_r

`with_scale_ties` adds a confounded scale error to the finding, as an alternative cause. A scale
error that is confounded with no finding may still exist. For example, a small one changes the
fitted inertias by less than the tolerance. `undetectable_scales` lists the scale errors of this
kind, and the report states that the recordings cannot identify them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from heli3dof.diagnosis.base_parameters import BaseParameter, OffNominal
from heli3dof.diagnosis.constants import SIGMAS_95
from heli3dof.diagnosis.result import Finding
from heli3dof.diagnosis.search.select import with_ties
from heli3dof.model.effects import term

ENCODER_SCALE = "encoder.scale"
ROLL_OFFSET = "encoder.offset.roll"
"""The cause with which a scale error of roll is confounded"""


def with_scale_ties(
    findings: Sequence[Finding], off: Sequence[OffNominal], numbers: Sequence[BaseParameter], *,
    rest_rad: float, tolerance: float,
) -> tuple[tuple[Finding, ...], tuple[OffNominal, ...]]:  # fmt: skip
    """Return ``findings`` and ``off``; their ``tied_with`` also names confounded encoder scales.

    - ``off``: base parameters off nominal
    - ``numbers``: estimates of all base parameters
    - ``rest_rad``: roll angle at rest on the table, where counts start
    - ``tolerance``: the profile's tolerance of the relative deviation from nominal
    """
    x = {c.name: (c.x, c.noise_std) for c in numbers}
    T_g = next((c.value for c in numbers if c.name == "T_g"), math.nan)
    ties = {f"inertia.{axis}": of for axis, of in _inertia_ties(x, tolerance).items()}
    roll_findings = [
        f for f in findings
        if f.term.name in (ROLL_OFFSET, "stiffness.pendulum.roll")
    ]  # fmt: skip
    for f in roll_findings:
        ln_k = _ln_k(_zero_error(f, T_g), rest_rad)
        if _is_possible(ln_k) and _is_consistent(x["J_roll"], -ln_k, tolerance):
            ties[f.term.name] = (f"{ENCODER_SCALE}.roll",)
            if x["J_roll"][0] * ln_k < 0:
                ties["inertia.roll"] = (f"{ENCODER_SCALE}.roll",)
    tied = (replace(f, choice=with_ties(f.choice, ties.get(f.term.name, ()))) for f in findings)
    return tuple(tied), tuple(with_ties(o, ties.get(o.term.name, ())) for o in off)


def undetectable_scales(
    tied: Sequence[str], axes: Sequence[str], *, rest_rad: float, tolerance: float,
    detectable_offset_deg: float = math.inf,
) -> tuple[str, ...]:  # fmt: skip
    """Return the encoder scale errors of the measured ``axes`` that the recordings cannot show.

    Usually a scale error looks like another inertia, so the recordings cannot show it. Roll may be
    an exception: the counts of its encoder start at the angle ``rest_rad``, not at zero. So an
    encoder with the relative scale error ε reads zero at the angle rest_rad (1 − 1/(1 + ε)).
    ``detectable_offset_deg`` is the least encoder offset that the recordings can show. If the angle
    for ε = ``tolerance`` is larger, the recordings can show the scale error, and roll is omitted.
    ``tied``: names of further scale errors to omit, because they are already reported.
    """
    detectable = abs(math.degrees(rest_rad)) * (1 - 1 / (1 + tolerance)) > detectable_offset_deg
    names = (f"{ENCODER_SCALE}.{axis}" for axis in axes if axis != "roll" or not detectable)
    return tuple(name for name in names if name not in tied)


def _inertia_ties(
    x: dict[str, tuple[float, float]], tolerance: float
) -> dict[str, tuple[str, ...]]:
    """Return {axis: names of encoder scale errors}, confounded with a wrong inertia of the axis.

    ``x``: {name of the inertia J: (ln(J/J_nominal), its standard deviation)}. ``tolerance``: the
    profile's tolerance of the relative deviation from nominal.
    """
    out: dict[str, list[str]] = {"pitch": [], "yaw": []}
    if _is_possible(-x["J_yaw"][0]):
        out["yaw"].append(f"{ENCODER_SCALE}.yaw")
    # Midway between −x_p and x_ψ, the values of ln k by pitch and yaw.
    (p, s_p), (y, s_y) = x["J_pitch"], x["J_yaw"]
    ln_k = (y - p) / 2
    if (
        _is_possible(ln_k)
        and _is_consistent((p, s_p), -ln_k, tolerance)
        and _is_consistent((y, s_y), ln_k, tolerance)
    ):
        out["pitch"].append(f"{ENCODER_SCALE}.pitch")
        out["yaw"].append(f"{ENCODER_SCALE}.pitch")
    return {axis: tuple(names) for axis, names in out.items()}


def _is_consistent(x: tuple[float, float], shift: float, tolerance: float) -> bool:
    """Return whether ln(J/J_nominal) of an inertia J equals ``shift`` within tolerance and noise.

    ``x``: (ln(J/J_nominal), its standard deviation σ). The difference between ln(J/J_nominal) and
    ``shift`` must be at most ln(1 + ``tolerance``) + `SIGMAS_95` σ.
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
    """Return ln k of roll from 1/k = 1 + ``zero_error``/``rest_rad``; NaN if no k > 0 solves it."""
    inverse = 1 + zero_error / rest_rad if rest_rad else math.nan
    return -math.log(inverse) if inverse > 0 else math.nan


def _is_possible(ln_k: float) -> bool:
    """Return whether k is within the bounds of the effect ``encoder.scale``."""
    k = term(f"{ENCODER_SCALE}.yaw").effect.parameters[0]
    return bool(np.isfinite(ln_k)) and k.low <= math.exp(ln_k) <= k.high
