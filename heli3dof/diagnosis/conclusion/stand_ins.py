"""Find causes that only compensated for a residual torque: stand-ins.

A torque outside the catalogue first raises the score of the most similar cause. With residual
torques (`unmodelled.unmodelled_torque`) in the fit as well, this stand-in loses its size in one
Gauss–Newton step. With A and g the information and score of the fit's parameters and the residual
torques, and ḡ the mean score in null simulations,

    δ = A⁻¹ (g − ḡ),       v' = v + δ_v,       Z'² = (v' − v_0)² / (A⁻¹)_vv

v is the cause's first parameter, v_0 its value without the effect. The same step without residual
torques gives the size v − v_0 and Z². A cause is unsure if Z'² < `MIN_EVIDENCE_SHARE` Z², and a
stand-in if also v' − v_0 is less than `MIN_SIZE_SHARE` of the size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.diagnosis.result import Finding
from heli3dof.diagnosis.unmodelled.torque_evidence import Nuisance
from heli3dof.diagnosis.unmodelled.unmodelled_torque import ResidualTorque
from heli3dof.diagnosis.validation.gain import pays
from heli3dof.identification.greybox.estimate import Estimate

MIN_EVIDENCE_SHARE = 0.25
"""Of Z². Chosen; not derived."""
MIN_SIZE_SHARE = 0.6
"""Of the size. Chosen; not derived."""
MIN_SIGMAS = 2.0
"""Standard deviations by which a size must differ from zero. Chosen; not derived."""
MIN_RATIO = 0.01
"""Least ratio of T_g to its value in the fit, so that a step cannot change its sign. Chosen."""


@dataclass(frozen=True)
class WithResidual:
    """Size and Z² of a cause, without and with the residual torques in the fit."""

    name: str
    size: float
    Z2: float
    size_with_residual: float
    Z2_with_residual: float

    @property
    def stands_in(self) -> bool:
        """Return True if the residual torques replace the cause."""
        shrunk = self.size_with_residual * np.sign(self.size) < MIN_SIZE_SHARE * abs(self.size)
        return bool(shrunk and self.unsure)

    @property
    def unsure(self) -> bool:
        """Return True if the residual torques take most of the cause's evidence."""
        return self.Z2_with_residual < MIN_EVIDENCE_SHARE * self.Z2


def sizes_with_residual(fit: Estimate, nuisance: Nuisance) -> tuple[WithResidual, ...]:
    """Return sizes of all terms of the fit; ``nuisance`` contains the residual torques."""
    n = len(fit.optimum.theta)
    g = centred_score(nuisance)
    inverse = np.linalg.pinv(nuisance.A, hermitian=True)
    inverse_without = np.linalg.inv(nuisance.A[:n, :n])
    step, step_without = inverse @ g, inverse_without @ g[:n]
    out = []
    for t in fit.structure.terms:
        j = next((i for i, f in enumerate(fit.free) if f.term == t.name), None)
        if j is None:  # a term without parameters
            continue
        f, v = fit.free[j], float(fit.values[j])
        slope = f.slope(v)
        size, size_with = (v + slope * float(d[j]) - f.null for d in (step_without, step))
        var, var_with = (slope**2 * float(m[j, j]) for m in (inverse_without, inverse))
        out.append(WithResidual(t.name, size, size**2 / var, size_with, size_with**2 / var_with))
    return tuple(out)


def base_with_residual(fit: Estimate, nuisance: Nuisance) -> tuple[np.ndarray, np.ndarray]:
    """Return ln of T_g and inertias relative to ``fit``, and standard deviations: (4,), (4,)."""
    inverse = np.linalg.pinv(nuisance.A, hermitian=True)
    slope = fit.slopes[:4] / fit.values[:4]  # ∂ ln v/∂θ
    step = slope * (inverse @ centred_score(nuisance))[:4]
    log = np.array([f.log for f in fit.free[:4]])
    return (
        np.where(log, step, np.log(np.maximum(1 + step, MIN_RATIO))),
        np.abs(slope) * np.sqrt(np.diag(inverse)[:4]),
    )


def stand_ins(
    findings: Sequence[Finding],
    fit: Estimate,
    residuals: Sequence[ResidualTorque],
    nuisance: Nuisance,
) -> tuple[str, ...]:
    """Return the causes that lose their size and evidence to the residual torques; () if none."""
    if not residuals:
        return ()
    named = {f.choice.term.name for f in findings if not f.choice.term.effect.of_base}
    return tuple(
        b.name for b in sizes_with_residual(fit, nuisance) if b.stands_in and b.name in named
    )


def marked_unsure(
    findings: Sequence[Finding],
    fit: Estimate,
    residuals: Sequence[ResidualTorque],
    nuisance: Nuisance,
) -> tuple[Finding, ...]:
    """Return the findings; those that are weak or unsure are marked "…-like".

    Also those with a gain whose interval contains zero, or a size below `MIN_SIGMAS` σ.
    """
    unsure = (
        {b.name for b in sizes_with_residual(fit, nuisance) if b.unsure} if residuals else set()
    )
    unsure |= insignificant(fit)
    return tuple(
        replace(f, like=f.choice.weak or f.choice.term.name in unsure or not pays(f.gain))
        for f in findings
    )


def insignificant(fit: Estimate) -> set[str]:
    """Return the terms whose first parameter is not significantly different from absence."""
    first = {f.term: j for j, f in reversed(list(enumerate(fit.free))) if f.term is not None}
    return {
        name
        for name, j in first.items()
        if not fit.free[j].log
        and abs(float(fit.values[j]) - fit.free[j].null) < MIN_SIGMAS * float(fit.std[j])
    }


def centred_score(nuisance: Nuisance) -> np.ndarray:
    """Return g − ḡ (p,)."""
    return nuisance.g if not len(nuisance.g_null) else nuisance.g - nuisance.g_null.mean(axis=0)


def with_resemblance(
    residuals: Sequence[ResidualTorque], names: Sequence[str]
) -> tuple[ResidualTorque, ...]:
    """Return the residual torques; the first becomes like ``names[0]`` unless like another."""
    if not residuals or residuals[0].like is not None or not names:
        return tuple(residuals)
    return (replace(residuals[0], like=f"{names[0]}-like"), *residuals[1:])
