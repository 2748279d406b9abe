"""Mark causes that residual torques make unsure.

A torque outside the catalogue raises the score of the most similar cause. With residual torques
(`unmodelled.unmodelled_torque`) in the fit as well, one Gauss–Newton step δ moves such a cause
towards zero. With A and g the information and score of the fit's parameters and the residual
torques, and ḡ the mean score in null simulations, the evidence for a cause is then Z'²:

    δ = A⁻¹ (g − ḡ),       v' = v + δ_v,       Z'² = (v' − v_0)² / (A⁻¹)_vv

v is the cause's first parameter, v_0 its value without the effect. The same step without residual
torques gives Z². A cause is unsure if Z'² < `MIN_EVIDENCE_SHARE` Z².
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from heli3dof.diagnosis.result import Finding
from heli3dof.diagnosis.unmodelled.torque_evidence import Nuisance
from heli3dof.diagnosis.unmodelled.unmodelled_torque import ResidualTorque
from heli3dof.diagnosis.validation.gain import pays
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.model.physics.parametrisation import first_parameters

MIN_EVIDENCE_SHARE = 0.25
"""Z'²/Z² below which a cause is unsure. Chosen; not derived."""
MIN_SIGMAS = 2.0
"""Standard deviations by which a size must differ from zero. Chosen; not derived."""


def evidence_with_residual(fit: Estimate, nuisance: Nuisance) -> dict[str, tuple[float, float]]:
    """Return {term: (Z², Z'²)}, the evidence without and with the residual torques (module).

    Terms without parameters are omitted. ``nuisance`` contains the residual torques.
    """
    n = len(fit.optimum.theta)
    g = centred_score(nuisance)
    inverse = np.linalg.pinv(nuisance.A, hermitian=True)
    inverse_without = np.linalg.inv(nuisance.A[:n, :n])
    step, step_without = inverse @ g, inverse_without @ g[:n]
    out = {}
    for name, j in first_parameters(fit.free).items():
        f, v = fit.free[j], float(fit.values[j])
        slope = f.slope(v)
        size, size_with = (v + slope * float(d[j]) - f.null for d in (step_without, step))
        var, var_with = (slope**2 * float(m[j, j]) for m in (inverse_without, inverse))
        out[name] = size**2 / var, size_with**2 / var_with
    return out


def marked_unsure(
    findings: Sequence[Finding],
    fit: Estimate,
    residuals: Sequence[ResidualTorque],
    nuisance: Nuisance,
) -> tuple[Finding, ...]:
    """Return the findings; those that are weak or unsure (module) are marked "…-like".

    So are findings of less than `MIN_SIGMAS` σ, and those that do not significantly improve the
    prediction of held-out data.
    """
    unsure = set[str]()
    if residuals:
        each = evidence_with_residual(fit, nuisance)
        unsure = {n for n, (alone, held) in each.items() if held < MIN_EVIDENCE_SHARE * alone}
    unsure |= insignificant(fit)
    return tuple(
        replace(f, like=f.choice.weak or f.choice.term.name in unsure or not pays(f.gain))
        for f in findings
    )


def insignificant(fit: Estimate) -> set[str]:
    """Return the terms whose first parameter is within `MIN_SIGMAS` σ of having no effect."""
    return {
        name
        for name, j in first_parameters(fit.free).items()
        if not fit.free[j].log
        and abs(float(fit.values[j]) - fit.free[j].null) < MIN_SIGMAS * float(fit.std[j])
    }


def centred_score(nuisance: Nuisance) -> np.ndarray:
    """Return the score minus its mean in null simulations, g − ḡ (p,)."""
    return nuisance.g if not len(nuisance.g_null) else nuisance.g - nuisance.g_null.mean(axis=0)


def with_resemblance(
    residuals: Sequence[ResidualTorque], names: Sequence[str]
) -> tuple[ResidualTorque, ...]:
    """Return the residual torques; the first is marked ``names[0]``-like unless it has a mark."""
    if not residuals or residuals[0].like is not None or not names:
        return tuple(residuals)
    return (replace(residuals[0], like=f"{names[0]}-like"), *residuals[1:])
