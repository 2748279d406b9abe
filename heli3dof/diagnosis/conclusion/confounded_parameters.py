"""Find out which effects are confounded with a wrong base parameter.

The base parameters are the thrust gain K_f, the trim torque T_g and three inertias J. They are
fitted together with the adopted causes. If the rig has an effect that the model lacks, the fit may
compensate for it with wrong base parameters. For example, a step about one hover voltage only
determines the ratio of thrust slope to inertia. So a curved thrust appears as a wrong inertia. This
module finds such effects in two ways.

**By score tests** (`confounded_causes`, for T_g and the inertias). The score test evaluates each
effect i at a trial size. Suppose that the rig has this effect with α times the trial size, and the
model lacks it. The fit of a parameter θ_j (T_g or an inertia, scaled) then has the bias α b_ji.
Here b_ji = (A⁻¹ T W δc_i)_j (symbols: `search.score_test`).

The profile's tolerance sets a lower and an upper limit of θ_j. Suppose that the fitted θ_j is
outside these limits. Effect i alone explains this deviation if θ_j − α b_ji, the value without the
bias, lies between the limits. θ_edge is one of the limits. θ_j − α b_ji is at this limit for

    α = (θ_j − θ_edge)/b_ji,        Z = α √v_i / std_i

Z is the expected value of the score-test statistic for an effect of this size, as standardised by
`search.nulls`. v_i is the Fisher information on α. std_i is the standard deviation of u_i/√v_i in
flights simulated without the effect, with the score u_i. In theory, std_i is 1. The two limits give
a range of α and a range of Z. Effect i is confounded with parameter j if both hold:

1. The α nearest to zero is plausible. The effect then has at most `LARGE` times its typical size,
   and a sign that a rig can have.
2. The statistic Z_i of the recordings lies in the range of Z, widened by `SIGMAS_997` on either
   side.

`confounded_with_thrust_gain` is a similar test for K_f.

**By refits** (`instead_of_inertia`, for inertias). In a short step flight, a slow torque and a
wrong inertia cause nearly the same motion. To find such torques, the model is refitted with one
more effect at a time. An effect is confounded with the wrong inertias if the refit meets two
conditions: it explains the recordings about as well, and its inertias are within the tolerance.
Only the effects with the largest Z² are tried.

`conclusion.confounded_encoder_scales` finds out which causes are confounded with a scale error of
an encoder.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from heli3dof.diagnosis.base_parameters import (
    FINDINGS,
    PARAMETERS,
    THRUST_GAIN,
    OffNominal,
    base_parameters,
    off_nominal,
)
from heli3dof.diagnosis.conclusion.confounded_encoder_scales import ENCODER_SCALE
from heli3dof.diagnosis.constants import LARGE, SIGMAS_95, SIGMAS_997, TIE
from heli3dof.diagnosis.search.candidate_fits import CandidateFit, fit_candidates
from heli3dof.diagnosis.search.screening import Screening, one_sided
from heli3dof.diagnosis.search.select import with_ties
from heli3dof.diagnosis.search.steps import Step
from heli3dof.identification.bias_correction.correction import CorrectedFit
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.thrust_scale import edge, of_ratios, thrust_scale

MAX_ALTERNATIVES = 6
"""Largest number of effects that are fitted as alternatives to wrong inertias. Chosen."""
SIZES = 21
"""Number of trial sizes, from zero to the largest. Chosen; not derived."""


def with_confounded_causes(off: Sequence[OffNominal], step: Step) -> tuple[OffNominal, ...]:
    """Return ``off``; the ``tied_with`` of each element also names the confounded effects.

    Each element of ``off`` states that a parameter differs from nominal: the thrust gain, the trim
    torque or an inertia. An effect is confounded with the parameter if it explains the same
    recordings without this difference. ``step`` contains the score tests of all effects.
    """
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
    """Return the names of the effects that are confounded with the wrong base parameter j.

    j is an index of `PARAMETERS`: the trim torque and three inertias.
    """
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
    """Return the names of the effects that are confounded with a wrong thrust gain K_f.

    No fit estimates K_f. Instead, a wrong K_f changes the fitted trim torque and inertias by the
    same factor, from which `greybox.thrust_scale` computes K_f. An effect that the model lacks may
    change this factor, because it biases the fitted parameters. Such an effect is confounded with a
    wrong K_f if two conditions hold (`plausible_terms`).
    """
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
        """Return ranges of α in which effect ``i`` explains why the thrust gain K_f is off nominal.

        Suppose that the rig has effect i with the size α · ``size``. ``size`` is the trial size of
        the score test, in the unit of the effect's first parameter. A fit without the effect then
        has biased parameters. The effect explains the deviation of K_f if K_f without this bias is
        within the profile's tolerance.

        There are at most two ranges, one for α > 0 and one for α < 0. A range is a tuple (α nearest
        to zero, α farthest from zero).
        """
        p, b = screen.plain[i], screen.solved[:4, i]
        largest = LARGE * p.term.effect.parameters[0].typical / abs(size)
        sizes = np.linspace(0.0, largest, SIZES)[1:]
        by_sign = [[s * a for a in sizes if abs(log_k(s * a, b)) < limit] for s in (1.0, -1.0)]
        return [(a[0], a[-1]) for a in by_sign if a]

    sizes = [(i, p.size) for i, p in enumerate(screen.plain) if p.size is not None]
    return plausible_terms(step, ((i, *a) for i, size in sizes for a in size_ranges(i, size)))


def plausible_terms(step: Step, ranges: Iterable[tuple[int, float, float]]) -> tuple[str, ...]:
    """Return the names of the effects that may explain why a fitted parameter is off nominal.

    A fit that lacks an effect of the rig has biased parameters, for example a wrong inertia.
    ``ranges`` contains tuples (i, α_1, α_2) with |α_1| ≤ |α_2|. Effect i alone explains the
    parameter's deviation if it has the size α s_i, with any α between α_1 and α_2. s_i is the trial
    size of effect i in the score test of ``step``.

    The function returns the name of effect i if both hold:

    - The smallest size α_1 s_i is plausible. It is at most `LARGE` times the typical size of effect
      i, and a rig can have its sign.
    - For the sizes α_1 s_i and α_2 s_i, the score-test statistic Z_i has two expected values. Z_i
      of the recordings lies between these values, or is outside by less than `SIGMAS_997`. If
      α_2 s_i exceeds `LARGE` times the typical size, this limit takes its place.
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
    """Return fits in which an added effect explains the data about as well as wrong inertias.

    An inertia counts as wrong if the current fit ``s.fit`` estimates it significantly off nominal,
    by more than the profile's tolerance. If no inertia is wrong, the result is empty.

    Otherwise, each of the `MAX_ALTERNATIVES` identifiable effects with the largest Z² is added to
    the model, and the model is refitted. Z² is the statistic of the score test ``s``; effects with
    Z² ≤ `SIGMAS_95`² are not fitted. A refit is returned if both hold:

    - Its BIC is better than that of the current fit, or worse by less than `TIE`.
    - It estimates all wrong inertias within the profile's tolerance.
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
    """Return ``off``; a wrong thrust gain K_f in it is marked as confounded with the inertias.

    Each element of ``off`` states that a parameter differs from nominal: K_f, the trim torque or an
    inertia. A K_f of f times nominal gives the same motion as a nominal K_f with three inertias of
    1/f times nominal (`greybox.thrust_scale`). So the function adds the inertias to ``tied_with``
    of K_f. It adds K_f to ``tied_with`` of all other elements of ``off``. If ``off`` does not
    contain K_f, the function changes nothing.

    A diagnosis by free-run predictions uses this function. Other diagnoses use
    `with_confounded_causes`, which needs score tests.
    """
    if not any(o.term.name == THRUST_GAIN for o in off):
        return tuple(off)
    _, *inertias = PARAMETERS
    return tuple(
        with_ties(o, inertias if o.term.name == THRUST_GAIN else [THRUST_GAIN]) for o in off
    )
