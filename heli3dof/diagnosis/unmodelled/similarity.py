"""Find the named cause whose effect on the innovations is most similar to a free-form torque's.

δ (E,) is the change of the E predicted readings by the torque, δ_p that by probe p of a named cause
(`screening.score_test`). Their correlation, with the fit's parameters projected out, is

    cos = ⟨δ, δ_p⟩/√(⟨δ, δ⟩⟨δ_p, δ_p⟩),      ⟨a, b⟩ = Σ w a b − (T w a)ᵀ A⁻¹ (T w b)

w (E,) is the information of the readings, T (p, E) the derivatives of the predicted readings by the
parameters, A (p, p) their information. If |cos| exceeds `LIKE`, the torque is reported as "…-like".
"""

from __future__ import annotations

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.constants import LEAST_SHARE
from heli3dof.diagnosis.screening.catalogue import candidates, probes
from heli3dof.diagnosis.screening.score_test import Screen
from heli3dof.diagnosis.sensitivity.projection import project_out
from heli3dof.identification.bias_correction.evaluation import evaluate
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.likelihood import FilterRun

LIKE = 0.9
"""|cos| from which torque and cause count as similar. Chosen; not derived."""


def named_traces(fit: Estimate) -> tuple[list[str], np.ndarray]:
    """Return names and changes (P, E) of E readings, by P probes of causes that ``fit`` lacks."""
    problem, o = fit.problem, fit.optimum
    axes = [a for a, measured in zip(AXES, problem.data.axes, strict=True) if measured]
    fitted = [t.name for t in fit.structure.terms]
    named = [
        p
        for t in candidates(fitted, axes)
        if not t.effect.formal
        for p in probes(t, problem.data.V)
    ]
    evaluation = evaluate(problem, o.theta, o.noise, with_noise_derivatives=False)
    return [p.name for p in named], Screen(problem, o.theta, evaluation, named).D


def similarity(
    named: tuple[list[str], np.ndarray],
    at: FilterRun,
    trace: np.ndarray,
    tangents: np.ndarray,
    A: np.ndarray,
) -> tuple[str, float]:
    """Return (most similar cause, |cos|) of a torque that changes predictions by ``trace`` (E,).

    ``named``: from `named_traces`. ``tangents`` T (p, E), A (p, p): of the parameters projected
    out, as in the module docstring.
    """
    names, D = named
    D = np.vstack([trace, D])
    projected = project_out(D, tangents, A, at.w)
    full, remaining = (np.einsum("ij,j,ij->i", D, at.w, x) for x in (D, projected))
    with_trace = projected @ (at.w * trace)
    informative = remaining > LEAST_SHARE * np.maximum(full, 1e-30)
    with np.errstate(invalid="ignore", divide="ignore"):
        cos = np.abs(np.where(informative, with_trace / np.sqrt(remaining[0] * remaining), 0.0))[1:]
    best = int(np.argmax(cos))
    return names[best], float(cos[best])
