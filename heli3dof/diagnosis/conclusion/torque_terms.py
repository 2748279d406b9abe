"""Extend the model by terms for residual torques that improve predictions of held-out data.

A residual torque is a torque that the fitted model lacks. Up to two terms are proposed for it: a
formula, then a piecewise linear curve (`unmodelled.torque_formula`). A proposed term is added to
the model, and all parameters are fitted again and bias-corrected. The first term with a significant
gain on held-out data (`adoption.is_significant_gain`) is adopted, unless it makes predictions worse
(`adoption.worsens`). If no term is adopted, the torque is dropped. If no term can be fitted, the
torque is reported without a term in the model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from heli3dof.diagnosis.base_parameters import in_SI
from heli3dof.diagnosis.conclusion.adoption import (
    AdoptionResult,
    is_significant_gain,
    log_likelihood_gain,
    with_size,
    worsens,
)
from heli3dof.diagnosis.result import Dropped, TorqueTerm
from heli3dof.diagnosis.search.candidate_fits import refit_with_term
from heli3dof.diagnosis.search.steps import bias_corrected
from heli3dof.diagnosis.unmodelled.torque_formula import Proposal, proposals
from heli3dof.diagnosis.unmodelled.unmodelled_torque import ResidualTorque
from heli3dof.diagnosis.validation.cross_validation import held_out
from heli3dof.diagnosis.validation.gain import gain
from heli3dof.identification.bias_correction.correction import CorrectedFit
from heli3dof.identification.closed_loop_fit.setup import Setup
from heli3dof.identification.greybox.thrust_scale import thrust_scale
from heli3dof.model.effects import term
from heli3dof.recording.recording import Recording


def with_torques(
    setup: Setup, result: AdoptionResult, holdout: Sequence[Recording]
) -> AdoptionResult:
    """Return ``result`` with model terms for the residual torques that improve predictions.

    A term is a formula or a curve that is proposed for a torque and added to the fit. The
    predictions are those of held-out data. The torques of ``result`` are treated as follows:

    - A torque that already has a term is kept unchanged.
    - A torque with a term that improves predictions is kept with this term.
    - A torque whose terms do not improve predictions is dropped. ``dropped`` then lists the term
      with the largest log-likelihood gain.
    - A torque for which no term can be fitted is kept without a term.
    """
    fit, after = result.fit, result.after
    kept, dropped = list[ResidualTorque](), list(result.dropped)
    for torque in result.residual_torques:
        if torque.term is not None:
            kept.append(torque)
            continue
        failed = list[Dropped]()
        for proposal in proposals(fit, torque):
            wider = fit_with(setup, fit, proposal)
            if not np.isfinite(wider.optimum.loglik):
                continue
            new = held_out(wider, holdout)
            g = gain(after, new, seed=setup.seed)
            if is_significant_gain(g) and not worsens(g, wider.structure.profile):
                fit, after = wider, new
                kept.append(replace(torque, term=TorqueTerm(proposal, {}, g)))
                break
            failed.append(Dropped(proposal.term, g))
        else:
            if failed:
                dropped.append(max(failed, key=lambda d: log_likelihood_gain(d.gain)))
            else:
                kept.append(torque)
    torques = tuple(kept)
    return replace(result, fit=fit, after=after, residual_torques=torques, dropped=tuple(dropped))


def with_sizes(result: AdoptionResult) -> AdoptionResult:
    """Return a copy of ``result`` in which all causes and torque terms have their final values.

    The final values are those in ``result.fit``, in SI units.
    """
    fit, scale = result.fit, thrust_scale(result.fit)

    def with_values(x: ResidualTorque) -> ResidualTorque:
        if x.term is None:
            return x
        return replace(x, term=replace(x.term, values=in_SI(fit, scale, x.term.proposal.term)))

    return replace(
        result,
        findings=tuple(with_size(f, fit, scale) for f in result.findings),
        residual_torques=tuple(map(with_values, result.residual_torques)),
    )


def fit_with(setup: Setup, fit: CorrectedFit, proposal: Proposal) -> CorrectedFit:
    """Return ``fit`` extended by the proposal's term, refitted and bias-corrected."""
    problem, optimum = refit_with_term(fit, term(proposal.term), proposal.start)
    return bias_corrected(setup, problem, optimum, fit)
