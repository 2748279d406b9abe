"""Extend the model by terms for residual torques that improve predictions of held-out data.

The proposals for a torque are at most a formula and a curve (`unmodelled.torque_formula`). Each is
fitted in full and bias-corrected. The first one with a significant gain on held-out data
(`adoption.is_significant_gain`) is adopted. If none has such a gain, the torque is dropped. If none
can be fitted, the torque is reported, but the model has no term for it.
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
)
from heli3dof.diagnosis.result import Dropped, TorqueTerm
from heli3dof.diagnosis.search.candidate_fits import with_term_at
from heli3dof.diagnosis.search.steps import bias_corrected
from heli3dof.diagnosis.unmodelled.torque_formula import Proposal, proposals
from heli3dof.diagnosis.unmodelled.unmodelled_torque import ResidualTorque
from heli3dof.diagnosis.validation.cross_validation import held_out
from heli3dof.diagnosis.validation.gain import Gain, gain
from heli3dof.identification.bias_correction.corrected_maximum import maximise_corrected
from heli3dof.identification.bias_correction.correction import CorrectedFit
from heli3dof.identification.closed_loop_fit.setup import Setup
from heli3dof.identification.greybox.thrust_scale import thrust_scale
from heli3dof.model.effects import term
from heli3dof.recording.recording import Recording


def with_torques(
    setup: Setup, result: AdoptionResult, holdout: Sequence[Recording]
) -> AdoptionResult:
    """Return ``result`` with a term in its fit for each torque that improves held-out predictions.

    A term is a formula or a curve proposed for the torque. A torque without such an improvement is
    dropped: ``dropped`` lists its proposed term with the largest log-likelihood gain. A torque for
    which no proposed term can be fitted is kept without a term.
    """
    fit, after = result.fit, result.after
    kept = list[tuple[ResidualTorque, tuple[Proposal, Gain] | None]]()
    dropped = list(result.dropped)
    for torque in result.residual_torques:
        failed = list[Dropped]()
        for proposal in proposals(fit, torque):
            wider = fit_with(setup, fit, proposal)
            if not np.isfinite(wider.optimum.loglik):
                continue
            new = held_out(wider, holdout)
            g = gain(after, new, seed=setup.seed)
            if is_significant_gain(g):
                fit, after = wider, new
                kept.append((torque, (proposal, g)))
                break
            failed.append(Dropped(proposal.term, g))
        else:
            if failed:
                dropped.append(max(failed, key=lambda d: log_likelihood_gain(d.gain)))
            else:
                kept.append((torque, None))
    scale = thrust_scale(fit)
    torques = tuple(
        replace(t, term=TorqueTerm(adopted[0], in_SI(fit, scale, adopted[0].term), adopted[1]))
        if adopted
        else t
        for t, adopted in kept
    )
    return replace(result, fit=fit, after=after, residual_torques=torques, dropped=tuple(dropped))


def fit_with(setup: Setup, fit: CorrectedFit, proposal: Proposal) -> CorrectedFit:
    """Return ``fit`` extended by the proposal's term, refitted and bias-corrected."""
    o = fit.optimum
    wide, start = with_term_at(fit.problem, o.theta, term(proposal.term), proposal.start)
    at = maximise_corrected(wide, start, o.noise, None)
    return bias_corrected(setup, wide, at, fit)
