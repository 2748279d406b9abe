"""Search for residual torques, and drop the causes that only compensate for such a torque.

Causes, alone or together, may compensate for a torque that the catalogue lacks. On pitch, a torque
k V_f V_b (front and back voltage) is, to first order about hover, a thrust mismatch and a constant
torque. So each cause, each pair and all causes together are compared with a formula in their place:
a torque c φ on one axis. The axis and the product φ of measured quantities are those that explain
most (`unmodelled.torque_formula`). Let ℓ_s be the log-likelihood with the causes (n_s parameters, N
filter updates), ℓ_φ that with the formula. With K formulas and the fit's variance inflation κ
(`Estimate.inflation`), the formula replaces the causes if

    2 (ℓ_φ − ℓ_s)/κ + (n_s − 1) ln N − 2 ln K > `constants.TIE`

The second summand is BIC for the causes' further parameters, the third the prior odds against one
formula of K. On a limit cycle, a wrong model's ℓ may be higher by hundreds. So if the controller is
known, flights are also simulated, with the causes and with the formula. The flights with the causes
must refute them: the recordings' ℓ_φ − ℓ_s lies beyond theirs, towards that of the flights with the
formula (`search.rivals.is_refuted`). The formula need not be the whole cause, since the search
continues. If the controller is unknown, a formula in place of a single cause must improve held-out
predictions. The RMSE on the formula's axis must decrease significantly, by more than the encoder's
rounding (`conclusion.unknown_controller`).

Causes that a formula replaces are removed. The others are fitted again, and adopted or dropped. The
search is repeated until no further cause is removed. A remaining cause is marked "…-like"
(unconfirmed) if one of these holds:

- Its size differs from zero by less than `SIGMAS_95` standard deviations.
- It does not significantly improve the prediction of held-out data.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.base_parameters import effect_size
from heli3dof.diagnosis.conclusion.adoption import AdoptionResult, adopted
from heli3dof.diagnosis.conclusion.unknown_controller import exceeds_rounding, is_biased
from heli3dof.diagnosis.constants import SIGMAS_95, TIE
from heli3dof.diagnosis.result import COMPENSATES, Dropped, Finding
from heli3dof.diagnosis.search.candidate_fits import bic_penalty
from heli3dof.diagnosis.search.rivals import ROUNDS, is_refuted, likelihoods
from heli3dof.diagnosis.search.steps import bias_corrected, without
from heli3dof.diagnosis.unmodelled.torque_evidence import evidence, evidence_without_nulls
from heli3dof.diagnosis.unmodelled.torque_formula import (
    PRODUCTS,
    product_scores,
    significant_formula,
    variable_of,
    with_product,
)
from heli3dof.diagnosis.unmodelled.unmodelled_torque import (
    ResidualTorque,
    TorqueLocation,
    significant_torques,
    split_off_slow_noise,
)
from heli3dof.diagnosis.validation.cross_validation import held_out
from heli3dof.diagnosis.validation.gain import gain, gain_interval_positive
from heli3dof.identification.bias_correction.corrected_maximum import maximise_corrected
from heli3dof.identification.bias_correction.correction import CorrectedFit, correct
from heli3dof.identification.closed_loop_fit.setup import Setup
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.identification.greybox.maximum_likelihood import Optimum
from heli3dof.model.physics.parametrisation import first_parameters
from heli3dof.recording.recording import Recording


def search_residual_torques(
    setup: Setup, start: AdoptionResult, holdout: Sequence[Recording], *, flights: int
) -> AdoptionResult:
    """Search the fit of ``start`` for residual torques; drop causes that only compensate for them.

    The torques found are added to those of ``start``, whose terms its fit contains. ``flights``:
    number of flights simulated without residual torque, per search.
    """
    if not start.fit.is_corrected:  # a cause that is now dropped may have prevented simulation
        start = _without(setup, start, (), holdout)
    now, proven = start, None
    first: tuple[ResidualTorque, ...] | None = None
    while True:
        scores = evidence(now.fit, setup.recordings, flights=flights, seed=setup.seed)
        if scores.null is None and proven is None:
            proven = significant_formula(scores)
        left, slow_noise = split_off_slow_noise(significant_torques(scores, proven))
        left = tuple(x for x in left if x.axis in setup.explained_axes)
        if not now.fit.is_corrected:
            left = tuple(x for x in left if not is_biased(now.fit, x.axis))
        causes = [f.term.name for f in now.findings if not f.term.effect.of_base]
        won = replaced_by_formula(setup, now.fit, causes, holdout)
        if won is None:
            break
        proven = won.formula.location
        first = left if first is None else first
        now = _without(setup, now, won.causes, holdout)
    if first is not None and not left:
        return _undecided(start, first)
    torques = (*start.modelled_torques, *left)
    return replace(now, residual_torques=torques, slow_noise=slow_noise)


def _undecided(start: AdoptionResult, left: tuple[ResidualTorque, ...]) -> AdoptionResult:
    """Return ``start`` with all causes unconfirmed, and with the residual torques ``left``.

    The search found ``left`` before it removed any cause. A formula explained the flight better
    than the removed causes, but in the model without these causes no residual torque is
    significant. So all causes and torques are uncertain.
    """
    return replace(
        start,
        findings=tuple(replace(f, unconfirmed=True) for f in start.findings),
        residual_torques=(*start.modelled_torques, *left),
        is_decided=False,
    )


def _without(
    setup: Setup, now: AdoptionResult, names: Sequence[str], holdout: Sequence[Recording]
) -> AdoptionResult:
    """Return ``now`` after removing the causes ``names``; the others are refitted and tested.

    The result lists ``names`` as dropped, with the gains that they had in ``now``. If ``names`` is
    empty and the fit still cannot be bias-corrected, the function returns ``now``.
    """
    fit = now.fit
    for name in names:
        fit = without(fit, name)
    fit = bias_corrected(setup, fit.problem, fit.optimum)
    if not names and not fit.is_corrected:
        return now
    kept = [f.choice for f in now.findings if f.term.name not in names]
    gains = {f.term.name: f.gain for f in now.findings}
    result = adopted(fit, kept, holdout, seed=setup.seed)
    replaced = (Dropped(n, gains[n], COMPENSATES) for n in names)
    return replace(result, dropped=(*now.dropped, *replaced, *result.dropped))


def marked_unconfirmed(findings: Sequence[Finding], fit: Estimate) -> tuple[Finding, ...]:
    """Return the findings; some of them are marked as unconfirmed ("…-like").

    These have a size that is `insignificant` in ``fit``, or they do not significantly increase the
    likelihood of held-out data.
    """
    small = insignificant(fit)
    return tuple(
        replace(f, unconfirmed=True)
        if f.term.name in small or not gain_interval_positive(f.gain)
        else f
        for f in findings
    )


def insignificant(fit: Estimate) -> set[str]:
    """Return the terms whose first parameter is within `SIGMAS_95` σ of having no effect."""
    sizes = {name: effect_size(fit, name) for name in first_parameters(fit.free)}
    return {name for name, s in sizes.items() if s and abs(s[0]) < SIGMAS_95 * s[1]}


@dataclass(frozen=True, eq=False)
class Formula:
    """The fit with the best formula, and the axis and variable of the formula's torque."""

    problem: Likelihood
    optimum: Optimum
    location: TorqueLocation


@dataclass(frozen=True, eq=False)
class Contest:
    """The comparison of a set of causes with a formula that may replace them.

    ``margin``: evidence for the formula, in units of 2 ln L: log-likelihood gain, BIC for the
    number of parameters, and prior odds of one formula among many.
    """

    causes: tuple[str, ...]
    formula: Formula
    margin: float


def replaced_by_formula(
    setup: Setup, fit: CorrectedFit, causes: Sequence[str], holdout: Sequence[Recording]
) -> Contest | None:
    """Compare each of the ``causes``, each pair and all together with a formula in their place.

    Return the comparison with the largest margin above `TIE` that simulated flights confirm, or
    None. If the controller is unknown, held-out predictions must confirm a formula in place of a
    single cause; a formula in place of several causes needs no confirmation. The held-out data are
    ``holdout`` or, if it is empty, blocks left out of the fit.
    """
    if not causes:
        return None
    o = fit.optimum
    ln_causes = maximise_corrected(fit.problem, o.theta, o.noise, None).loglik
    sizes = {1, min(2, len(causes)), len(causes)}
    sets = [some for n in sorted(sizes) for some in itertools.combinations(causes, n)]
    contests = [contest(fit, ln_causes, some) for some in sets]
    won = sorted((c for c in contests if c.margin > TIE), key=lambda c: -c.margin)

    def is_confirmed(c: Contest) -> bool:
        if setup.controller_is_known:
            return simulations_refute(setup, fit, c.formula)
        return len(c.causes) > 1 or predictions_agree(setup, fit, c.formula, holdout)

    return next(filter(is_confirmed, won), None)


def predictions_agree(
    setup: Setup, fit: CorrectedFit, formula: Formula, holdout: Sequence[Recording]
) -> bool:
    """Return whether the formula predicts held-out data better than ``fit``, which has the causes.

    The RMSE of the formula's axis must decrease significantly, by more than encoder rounding.
    """
    wide = CorrectedFit(formula.problem, formula.optimum)
    g = gain(held_out(fit, holdout), held_out(wide, holdout), seed=setup.seed)
    return exceeds_rounding(g, fit.structure.profile, axes=[formula.location.axis])


def simulations_refute(setup: Setup, fit: CorrectedFit, formula: Formula) -> bool:
    """Return whether simulated flights refute the causes, which ``fit`` contains.

    Flights are simulated with the causes and with the formula (`search.rivals.is_refuted`). If
    ``fit`` could not be bias-corrected by simulated flights, the result is True.
    """
    if not fit.is_corrected:
        return True
    o = formula.optimum
    corrected = correct(
        formula.problem, [(o.theta, o.noise)], setup.recordings, seed=setup.seed,
        flights_per_round=setup.flights_per_round, rounds=ROUNDS,
    )  # fmt: skip
    return is_refuted(*likelihoods([fit, corrected], setup.recordings, seed=setup.seed), 0, 1)


def contest(fit: CorrectedFit, ln_causes: float, causes: tuple[str, ...]) -> Contest:
    """Return the comparison of ``causes``, taken together, with the best formula in their place.

    ``margin`` is −∞ if the formula cannot be fitted. ``ln_causes``: log-likelihood of ``fit``,
    which contains the causes.
    """
    less = fit
    for name in causes:
        less = without(less, name)
    parameters = sum(f.term in causes for f in fit.free)
    formula = with_best_product(less)
    ln_formula = formula.optimum.loglik
    gain = 2 * (ln_formula - ln_causes) / max(fit.inflation, 1.0)
    formulas = len(AXES) * len(PRODUCTS)
    penalty = bic_penalty(parameters - 1, fit.optimum.at) - 2 * float(np.log(formulas))
    return Contest(causes, formula, float(gain + penalty) if np.isfinite(ln_formula) else -np.inf)


def with_best_product(fit: CorrectedFit) -> Formula:
    """Return ``fit`` extended by one torque c φ, with the coefficient c refitted.

    The axis, and the product φ of measured quantities, are those that explain most.
    """
    x = evidence_without_nulls(fit)
    axes = np.flatnonzero(fit.problem.data.axes)
    scores = {int(i): product_scores(x, int(i)) for i in axes}
    i = max(scores, key=lambda i: float(scores[i][0].max()))
    S, c = scores[i]
    k = int(S.argmax())
    problem, optimum = with_product(fit, AXES[i], PRODUCTS[k], float(c[k]))
    return Formula(problem, optimum, TorqueLocation(AXES[i], variable_of(PRODUCTS[k])))
