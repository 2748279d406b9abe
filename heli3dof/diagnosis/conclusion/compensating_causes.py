"""Search for residual torques, and drop the causes that only compensate for such a torque.

A residual torque is a torque that the fitted model lacks. If the catalogue of effects does not
contain it, other effects may compensate for it, and are then found as causes. Example: on pitch, a
torque k V_f V_b (front and back voltage) equals, to first order about hover, a thrust mismatch and
a constant torque.

So the causes are compared with a formula: a torque c φ on one axis. φ is a product of measured
quantities, c a coefficient. The formula takes the place of one cause, of two, or of all. Its axis
and φ are those with the largest score-test statistic (`unmodelled.torque_formula`). The formula
replaces the causes if

    2 (ℓ_φ − ℓ_s)/κ + (n_s − 1) ln N − 2 ln K > `constants.TIE`

- ℓ_s: log-likelihood of the model with all causes
- ℓ_φ: log-likelihood of the model with the formula in place of some causes
- n_s: number of parameters of the causes that the formula replaces
- κ: variance inflation of the fit's scores (`Estimate.inflation`), at least 1
- (n_s − 1) ln N: BIC penalty for n_s parameters instead of the formula's single one; N is the
  number of filter updates
- 2 ln K: penalty for the choice of one formula among K, each with the prior probability 1/K

**Confirmation.** On a limit cycle, ℓ of a wrong model may be higher by hundreds. So the inequality
alone is not enough:

- If the controller is known, some flights are simulated from the model with the causes, and others
  from the model with the formula. Δ = ℓ_φ − ℓ_s is computed for each flight and for the recordings.
  Its mean is Δ_s over the flights with the causes, and Δ_φ over those with the formula. The causes
  are refuted if Δ of the recordings differs significantly from Δ_s, in the direction of Δ_φ
  (`search.rivals.is_refuted`). Only then does the formula replace the causes. Δ of the recordings
  may also differ significantly from Δ_φ. The formula is then only a part of the true torque, and
  the search continues.
- If the controller is unknown, a formula in place of a single cause must improve held-out
  predictions. The RMSE on its axis must decrease significantly, by more than the encoder's rounding
  (`conclusion.unknown_controller`). A formula in place of several causes needs no confirmation.

Replaced causes are removed from the model. The other causes are fitted again, and each is adopted
or dropped (`conclusion.adoption`). Then the search for residual torques is repeated, until no
formula replaces a cause.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.conclusion.adoption import AdoptionResult, adopted
from heli3dof.diagnosis.conclusion.doubtful_findings import marked_like
from heli3dof.diagnosis.conclusion.unknown_controller import exceeds_rounding, is_biased
from heli3dof.diagnosis.constants import TIE
from heli3dof.diagnosis.result import COMPENSATES, Dropped
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
from heli3dof.diagnosis.validation.gain import gain
from heli3dof.identification.bias_correction.corrected_maximum import maximise_corrected
from heli3dof.identification.bias_correction.correction import CorrectedFit, correct
from heli3dof.identification.closed_loop_fit.setup import Setup
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.identification.greybox.maximum_likelihood import Optimum
from heli3dof.recording.recording import Recording


def search_residual_torques(
    setup: Setup, start: AdoptionResult, holdout: Sequence[Recording], *, flights: int
) -> AdoptionResult:
    """Search for residual torques: torques that the rig has, but the model of ``start.fit`` lacks.

    The function drops causes that only compensate for such a torque. The result contains the
    residual torques that this search found. It keeps those that an earlier search found, if the
    model of ``start`` already has a term for them. ``flights``: number of null simulations of each
    search. A null simulation is a flight simulated from the fitted model, without residual torque.
    """
    if not start.fit.is_corrected:  # a cause that is now dropped may have prevented simulation
        start = _refitted_without(setup, start, (), holdout)
    now, proven = start, None
    first: tuple[ResidualTorque, ...] | None = None
    while True:
        scores = evidence(now.fit, setup.recordings, flights=flights, seed=setup.seed)
        if scores.null is None and proven is None:
            proven = significant_formula(scores)
        torques, slow_noise = split_off_slow_noise(significant_torques(scores, proven))
        torques = tuple(x for x in torques if x.axis in setup.explained_axes)
        if not now.fit.is_corrected:
            torques = tuple(x for x in torques if not is_biased(now.fit, x.axis))
        causes = [f.term.name for f in now.findings if not f.term.effect.of_base]
        won = replaced_by_formula(setup, now.fit, causes, holdout)
        if won is None:
            break
        proven = won.formula.location
        first = torques if first is None else first
        now = _refitted_without(setup, now, won.causes, holdout)
    if first is not None and not torques:
        return _all_unconfirmed(start, first)
    return replace(now, residual_torques=(*start.modelled_torques, *torques), slow_noise=slow_noise)


def _all_unconfirmed(start: AdoptionResult, torques: tuple[ResidualTorque, ...]) -> AdoptionResult:
    """Return ``start`` with all causes marked as unconfirmed, and with ``torques`` added.

    The caller uses it if two results contradict each other. First, a formula for a residual torque
    explained the recordings better than some causes, so these causes were removed. Then, in the
    model without them, no residual torque was significant. ``torques``: the residual torques found
    before any cause was removed.
    """
    return replace(
        start,
        findings=tuple(marked_like(f) for f in start.findings),
        residual_torques=(*start.modelled_torques, *torques),
        is_decided=False,
    )


def _refitted_without(
    setup: Setup, now: AdoptionResult, names: Sequence[str], holdout: Sequence[Recording]
) -> AdoptionResult:
    """Return ``now`` without the causes ``names``; the other causes are refitted and tested again.

    The result also lists ``names`` as dropped causes. The gain on held-out data that it states for
    each of them is copied from ``now`` (`Finding.gain`).

    If ``names`` is empty, the model keeps all causes. The function then only repeats two steps.
    First, it simulates flights to correct the bias of the fit. Second, it tests all causes on
    held-out data. If the first step fails, the function returns ``now`` unchanged.
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


@dataclass(frozen=True, eq=False)
class Formula:
    """A fit whose model contains a torque c φ on one axis.

    φ is a product of measured quantities, c a fitted coefficient. ``location``: the torque's axis,
    and the variable on which it depends.
    """

    problem: Likelihood
    optimum: Optimum
    location: TorqueLocation


@dataclass(frozen=True, eq=False)
class Replacement:
    """The comparison of two models: one with ``causes``, one with a torque formula instead.

    A torque formula is a torque c φ on one axis, proportional to a product φ of measured
    quantities.
    """

    causes: tuple[str, ...]
    formula: Formula
    margin: float
    """Evidence for the formula, in units of 2 ln L: the left side of the module's inequality. It is
    the sum of the log-likelihood's increase, the BIC penalty for the additional parameters of the
    causes, and the penalty for the choice of one formula among many."""


def replaced_by_formula(
    setup: Setup, fit: CorrectedFit, causes: Sequence[str], holdout: Sequence[Recording]
) -> Replacement | None:
    """Return the best replacement of causes by a torque formula, or None if the causes are better.

    A torque formula is a torque c φ on one axis, proportional to a product φ of measured
    quantities. It may take the place of one of the ``causes``, of two, or of all. The result is the
    replacement with the most evidence for the formula (`Replacement.margin`), among those that meet
    two conditions. First, the evidence exceeds `TIE`. Second, the replacement is confirmed:

    - If the controller is known, simulated flights must refute the causes (`simulations_refute`).
    - If the controller is unknown, a formula in place of a single cause must improve held-out
      predictions (`predictions_agree`). A formula in place of several causes needs no confirmation.

    The held-out data are ``holdout`` or, if it is empty, blocks left out of the fit.
    """
    if not causes:
        return None
    o = fit.optimum
    ln_causes = maximise_corrected(fit.problem, o.theta, o.noise, None).loglik
    sizes = {1, min(2, len(causes)), len(causes)}
    sets = [some for n in sorted(sizes) for some in itertools.combinations(causes, n)]
    compared = [replacement(fit, ln_causes, some) for some in sets]
    better = sorted((r for r in compared if r.margin > TIE), key=lambda r: -r.margin)

    def is_confirmed(r: Replacement) -> bool:
        if setup.controller_is_known:
            return simulations_refute(setup, fit, r.formula)
        return len(r.causes) > 1 or predictions_agree(setup, fit, r.formula, holdout)

    return next(filter(is_confirmed, better), None)


def predictions_agree(
    setup: Setup, fit: CorrectedFit, formula: Formula, holdout: Sequence[Recording]
) -> bool:
    """Return whether the model with the formula predicts held-out data better than ``fit``.

    ``fit`` contains the causes that the formula may replace. With the formula, the RMSE on its axis
    must be smaller, significantly and by more than encoder rounding.
    """
    wide = CorrectedFit(formula.problem, formula.optimum)
    g = gain(held_out(fit, holdout), held_out(wide, holdout), seed=setup.seed)
    return exceeds_rounding(g, fit.structure.profile, axes=[formula.location.axis])


def simulations_refute(setup: Setup, fit: CorrectedFit, formula: Formula) -> bool:
    """Return whether simulated flights refute the causes in ``fit`` in favour of a torque formula.

    ``formula`` contains the fit with a torque c φ in place of some of these causes; φ is a product
    of measured quantities. Flights of both fits are simulated. Δ is the log-likelihood with the
    formula minus the log-likelihood with the causes. The causes are refuted if Δ of the recordings
    differs significantly from Δ in the flights simulated with the causes, towards Δ in those with
    the formula (`search.rivals.is_refuted`).

    If ``fit`` could not be bias-corrected by simulated flights, the result is True.
    """
    if not fit.is_corrected:
        return True
    o = formula.optimum
    corrected = correct(
        formula.problem, [(o.theta, o.noise)], setup.recordings, seed=setup.seed,
        flights_per_round=setup.flights_per_round, rounds=ROUNDS,
    )  # fmt: skip
    return is_refuted(*likelihoods([fit, corrected], setup.recordings, seed=setup.seed), 0, 1)


def replacement(fit: CorrectedFit, ln_causes: float, causes: tuple[str, ...]) -> Replacement:
    """Compare ``fit`` with a model in which one torque formula replaces all of ``causes``.

    The formula is the best one of `with_best_product`: a torque c φ on one axis, proportional to a
    product φ of measured quantities. ``ln_causes``: log-likelihood of ``fit``, which contains the
    causes. The result's ``margin``, the evidence for the formula, is −∞ if the formula cannot be
    fitted.
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
    margin = float(gain + penalty) if np.isfinite(ln_formula) else -np.inf
    return Replacement(causes, formula, margin)


def with_best_product(fit: CorrectedFit) -> Formula:
    """Return ``fit`` extended by one torque c φ on one axis, with all parameters refitted.

    φ is a product of measured quantities, c its coefficient. The axis and φ are those with the
    largest score-test statistic.
    """
    x = evidence_without_nulls(fit)
    axes = np.flatnonzero(fit.problem.data.axes)
    scores = {int(i): product_scores(x, int(i)) for i in axes}
    i = max(scores, key=lambda i: float(scores[i][0].max()))
    S, c = scores[i]
    k = int(S.argmax())
    problem, optimum = with_product(fit, AXES[i], PRODUCTS[k], float(c[k]))
    return Formula(problem, optimum, TorqueLocation(AXES[i], variable_of(PRODUCTS[k])))
