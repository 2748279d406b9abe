"""Report what is confounded with a wrong base parameter, or with a wrong encoder scale.

**Absorbed effects.** The base fit absorbs some effects completely. For example, a step about one
hover voltage only determines the ratio of thrust slope and inertia, so a curved thrust appears as
another inertia.

A probe i is an effect of a trial size. It changes the base fit's scaled parameter θ_j of T_g or an
inertia by b_ji = (A⁻¹ T W δc_i)_j (symbols: `search.score_test`). θ_edge is the limit that the
profile's tolerance sets for θ_j. If effect i alone explains why θ_j is beyond θ_edge, its size α
(in units of the probe) and its statistic Z are at least

    α = (θ_j − θ_edge)/b_ji,        Z = α √v_i / std_i

and at most those for the opposite limit. v_i is the information of probe i, std_i the standard
deviation of its score in simulated flights without the effect. Effect i is confounded with
parameter j if

1. α is possible: at most `LARGE` typical sizes, and of the right sign;
2. the measured Z_i lies within this range of Z, widened by `SIGMAS_997`.

A wrong K_f scales all four parameters alike (`greybox.thrust_scale`). For K_f the same conditions
apply with another range of α: the corrected parameters θ_j − α b_ji must give a K_f within the
tolerance.

In a short step flight, a slow torque has nearly the effect of a wrong inertia. The base fit absorbs
the torque in the inertia J_j; a full fit with the torque returns J_j to nominal. If an inertia is
significantly off nominal (`diagnosis.base_parameters`), terms with Z² > `SIGMAS_95`² are fitted in
full, at most `MAX_ALTERNATIVES`. A term is confounded with the inertias off nominal if both hold:

- Its BIC score (`search.candidate_fits`) exceeds −`TIE`.
- Its fit puts all these inertias within the profile's tolerance ε: ln(1 − ε) ≤ ln(J_j/J_j,nominal)
  ≤ ln(1 + ε).

**Encoder scales.** An encoder with scale error k reads y = rest + k (q − rest) at the angle q. rest
is the angle at which counts start. A flight with this error looks like a flight without it, but
with other inertias J. With roll r, pitch p, yaw ψ, arm length L_a and thrust F:

    yaw     ψ = y/k:  k L_a F cos r sin p = J_ψ ÿ, so an inertia J_ψ/k
    pitch   an inertia J_p/k; sin p ≈ y/k drives yaw, so also an inertia k J_ψ
    roll    an inertia J_r/k; y = 0 at q = rest (1 − 1/k), so an offset or a pendulum torque

The two flights differ only in products of rates and in higher-order terms of the sines.

Let x = ln(J/J_nominal) for a fitted inertia J, σ the standard deviation of x, ε the profile's
tolerance and e = ln(1 + ε) + `SIGMAS_95` σ. δ is the roll offset found, or asin(τ/T_g) for a
pendulum torque τ and the trim torque T_g. A finding is confounded with the scale error k of an axis
if k meets the conditions in the row of the axis, within the bounds of the effect ``encoder.scale``:

    yaw     ln k = −x_ψ
    pitch   ln k = (x_ψ − x_p)/2,   |x_p + ln k| ≤ e_p   and   |x_ψ − ln k| ≤ e_ψ
    roll    1/k = 1 + δ/rest   and   |x_r + ln k| ≤ e_r

If there is no such finding, the recordings cannot show a scale error of yaw or pitch within the
tolerance. They show one of roll if the roll offset rest (1 − 1/(1 + ε)) is detectable.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from heli3dof.diagnosis.base_parameters import (
    FINDINGS,
    PARAMETERS,
    THRUST_GAIN,
    BaseParameter,
    OffNominal,
    base_parameters,
    off_nominal,
)
from heli3dof.diagnosis.constants import LARGE, SIGMAS_95, SIGMAS_997, TIE
from heli3dof.diagnosis.result import Finding
from heli3dof.diagnosis.search.candidate_fits import CandidateFit, fit_candidates
from heli3dof.diagnosis.search.screening import Screening, one_sided
from heli3dof.diagnosis.search.select import with_ties
from heli3dof.diagnosis.search.steps import Step
from heli3dof.identification.bias_correction.correction import CorrectedFit
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.thrust_scale import edge, of_ratios, thrust_scale
from heli3dof.model.effects import term

MAX_ALTERNATIVES = 6
"""Most candidates fitted in full as alternatives to a wrong inertia. Chosen; not derived."""
SIZES = 21
"""Number of trial sizes, from zero to the largest. Chosen; not derived."""
ENCODER_SCALE = "encoder.scale"
ROLL_OFFSET = "encoder.offset.roll"
"""The cause with which a scale error of roll is confounded"""


def with_confounded_causes(off: Sequence[OffNominal], step: Step) -> tuple[OffNominal, ...]:
    """Return ``off``; the ``tied_with`` of each names the effects that are confounded with it."""
    is_inertia = [o.term.effect.name == "inertia" for o in off]
    alternatives = [f.term.name for f in instead_of_inertia(step)] if any(is_inertia) else []

    def confounded(o: OffNominal) -> tuple[str, ...]:
        if o.term.name == THRUST_GAIN:
            return confounded_with_thrust_gain(step)
        return confounded_causes(step, PARAMETERS.index(o.term.name))

    return tuple(
        with_ties(o, (*confounded(o), *alternatives * with_fits))
        for o, with_fits in zip(off, is_inertia, strict=True)
    )


def last_step_with_causes(steps: Sequence[Step], fit: CorrectedFit) -> Step:
    """Return the last step whose fit has the same terms as ``fit``.

    If no step has these terms, the result is the last of all steps.
    """
    names = {t.name for t in fit.structure.terms}
    same = (s for s in reversed(steps) if {t.name for t in s.fit.structure.terms} == names)
    return next(same, steps[-1])


def confounded_causes(step: Step, j: int) -> tuple[str, ...]:
    """Return the terms confounded with base parameter j, an index of `PARAMETERS`."""
    fit, screen = step.fit, step.screen
    f, value = fit.free[j], float(fit.values[j]) * thrust_scale(fit).k
    if value / f.start <= 0:
        return ()
    x, v = float(np.log(value / f.start)), float(fit.values[j])
    tolerance = fit.structure.profile.tolerance
    same_side, other_side = (float(np.exp(edge(s, tolerance) - x)) for s in (x, -x))
    least, most = (
        f.scaled(v) - f.scaled(v * same_side),
        f.scaled(v) - f.scaled(v * other_side),
    )
    solved = enumerate(screen.solved[j, : len(screen.plain)])
    return plausible_terms(step, ((i, least / b, most / b) for i, b in solved if b))


def confounded_with_thrust_gain(step: Step) -> tuple[str, ...]:
    """Return the terms confounded with the thrust gain K_f."""
    fit, screen = step.fit, step.screen
    base, half = fit.free[:4], 0.5 * fit.structure.profile.tolerance
    nominal = np.array([f.start for f in base])
    std = fit.std[:4] / np.abs(nominal)
    at = np.array([f.scaled(float(v)) for f, v in zip(base, fit.values, strict=False)])

    def log_k(amount: float, b: np.ndarray) -> float:
        x = np.array([f.unscaled(float(c)) for f, c in zip(base, at - amount * b, strict=True)])
        return float(np.log(of_ratios(x / nominal, std, half).k))

    limit = abs(edge(log_k(0.0, np.zeros(4)), fit.structure.profile.tolerance))

    def size_ranges(i: int, size: float) -> list[tuple[float, float]]:
        """Return the range (least, most) of α > 0 and that of α < 0, each left out if empty.

        With α in a range, α times the trial effect ``i`` explains a wrong K_f: the parameters
        corrected for it give a K_f within the profile's tolerance. ``size``: of the trial effect.
        """
        p, b = screen.plain[i], screen.solved[:4, i]
        largest = LARGE * p.term.effect.parameters[0].typical / abs(size)
        sizes = np.linspace(0.0, largest, SIZES)[1:]
        by_sign = [[s * a for a in sizes if abs(log_k(s * a, b)) < limit] for s in (1.0, -1.0)]
        return [(a[0], a[-1]) for a in by_sign if a]

    sizes = [(i, p.size) for i, p in enumerate(screen.plain) if p.size is not None]
    return plausible_terms(step, ((i, *a) for i, size in sizes for a in size_ranges(i, size)))


def plausible_terms(step: Step, ranges: Iterable[tuple[int, float, float]]) -> tuple[str, ...]:
    """Return the names of the terms that alone may explain a wrong base parameter.

    ``ranges``: (index i of a trial effect, least α, largest α). With α in this range, α times the
    trial effect i explains the wrong parameter. The range must contain a size of at most `LARGE`
    typical sizes, and of the right sign. The effect's Z must lie in the corresponding range of Z,
    widened by `SIGMAS_997` on either side.
    """
    screen, Z = step.screen, step.Z

    def is_plausible(i: int, least: float, most: float) -> bool:
        p = screen.plain[i]
        if (
            p.term.effect.formal
            or p.size is None
            or not np.isfinite(screen.v[i])
            or (least < 0 and one_sided(p))
        ):
            return False
        largest = LARGE * p.term.effect.parameters[0].typical * (1 + 1e-9)
        if abs(least * p.size) > largest:
            return False
        most = np.clip(most, -largest / abs(p.size), largest / abs(p.size))
        z_per_unit = float(np.sqrt(screen.v[i])) / float(step.nulls.std[i])
        low, high = sorted((least * z_per_unit, most * z_per_unit))
        return bool(low - SIGMAS_997 < float(Z[i]) < high + SIGMAS_997)

    return tuple(dict.fromkeys(screen.plain[i].name for i, *a in ranges if is_plausible(i, *a)))


def instead_of_inertia(s: Screening) -> list[CandidateFit]:
    """Return the fits of candidates that may replace the deviations of all inertias off nominal.

    The first `MAX_ALTERNATIVES` identifiable terms with Z² > `SIGMAS_95`² are fitted. A fit is
    returned if its score exceeds −`TIE`, and if it puts all these inertias within the profile's
    tolerance. The result is empty if no inertia is off nominal.
    """
    off = {o.term.name for o in off_nominal(s.fit) if o.term.effect.name == "inertia"}
    if not off:
        return []
    hidden, tolerance = s.not_identifiable, s.fit.structure.profile.tolerance
    shown = (r for r in s.ranked if r[1] > SIGMAS_95**2 and r[0].name not in hidden)
    ranked = [r for r in shown if not r[0].effect.formal][:MAX_ALTERNATIVES]

    def restores(f: CandidateFit) -> bool:
        numbers = base_parameters(Estimate(f.problem, f.optimum))
        return all(c.excess(tolerance) <= 0 for c in numbers if FINDINGS[c.name] in off)

    return [f for f in fit_candidates(s, ranked) if f.score > -TIE and restores(f)]


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

    Counts start at the rest angle ``rest_rad``, so a wrong roll scale also shifts the level angle.
    ``detectable_offset_deg``: least detectable shift. ``tolerance``: relative scale error; roll is
    omitted if its shift at this error is detectable. ``tied``: scale errors to omit, because they
    are already reported.
    """
    detectable = abs(math.degrees(rest_rad)) * (1 - 1 / (1 + tolerance)) > detectable_offset_deg
    names = (f"{ENCODER_SCALE}.{axis}" for axis in axes if axis != "roll" or not detectable)
    return tuple(name for name in names if name not in tied)


def separable_by_flight(of: str, tied_with: Sequence[str]) -> tuple[str, ...]:
    """Return the causes in ``tied_with`` that a flight can separate from the cause ``of``.

    No flight separates an encoder scale error from other causes. Nor does a flight separate the
    thrust gain from an inertia or `mass.imbalance`.

    >>> separable_by_flight("inertia.roll", [THRUST_GAIN, "encoder.scale.yaw"])
    ()
    >>> separable_by_flight("motor.dead_zone", [THRUST_GAIN])
    ('motor.thrust_gain',)
    >>> separable_by_flight(THRUST_GAIN, ["inertia.roll"])
    ()
    """

    def are_scaled_alike(a: str, b: str) -> bool:
        return a == THRUST_GAIN and b in PARAMETERS

    return tuple(
        n
        for n in tied_with
        if not (n.startswith(ENCODER_SCALE) or are_scaled_alike(n, of) or are_scaled_alike(of, n))
    )


def with_thrust_gain_ties(off: Sequence[OffNominal]) -> tuple[OffNominal, ...]:
    """Return ``off``, with further confounded causes if the thrust gain K_f is off nominal.

    K_f is then confounded with the inertias, and every other base parameter off nominal with K_f.
    Without simulated flights, only the profile's nominal values separate a wrong K_f from inertias
    that are all wrong by the inverse factor (`greybox.thrust_scale`).
    """
    if not any(o.term.name == THRUST_GAIN for o in off):
        return tuple(off)
    _, *inertias = PARAMETERS
    return tuple(
        with_ties(o, inertias if o.term.name == THRUST_GAIN else [THRUST_GAIN]) for o in off
    )


def _inertia_ties(
    x: dict[str, tuple[float, float]], tolerance: float
) -> dict[str, tuple[str, ...]]:
    """Return {axis: encoder scale errors confounded with a wrong inertia of this axis}.

    ``x``: {name of the inertia J: (ln(J/J_nominal), its standard deviation)}.
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
    """Return whether J/J_nominal of an inertia J is exp(``shift``), within tolerance and noise.

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
    inverse = 1 + zero_error / rest_rad if rest_rad else math.nan
    return -math.log(inverse) if inverse > 0 else math.nan


def _is_possible(ln_k: float) -> bool:
    k = term(f"{ENCODER_SCALE}.yaw").effect.parameters[0]
    return bool(np.isfinite(ln_k)) and k.low <= math.exp(ln_k) <= k.high
