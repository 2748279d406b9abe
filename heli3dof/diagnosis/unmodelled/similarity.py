"""Which named cause a free-form torque resembles, in the only sense that counts: what it does.

δ is the leftover's trace in the innovations, δ_p that of a named cause's probe
(`screening.score_test`), both with what the fit already holds projected out; with the events'
informations w,

    cos = ⟨δ, δ_p⟩/√(⟨δ, δ⟩⟨δ_p, δ_p⟩),      ⟨a, b⟩ = Σ w a b − (T w a)ᵀ A⁻¹ (T w b)

Above `LIKE` this flight can hardly tell them apart, and the leftover is called "…-like".
"""

from __future__ import annotations

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.estimate.evaluation import evaluate
from heli3dof.diagnosis.screening.catalogue import candidates, probes
from heli3dof.diagnosis.screening.score_test import Screen
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.likelihood import Pass

LIKE = 0.9


def named_traces(found: Estimate) -> tuple[list[str], np.ndarray]:
    """(names, (P, E) δ_p) of every probe of every cause that ``found`` does not hold."""
    problem, o = found.problem, found.optimum
    axes = [a for a, there in zip(AXES, problem.data.axes, strict=True) if there]
    taken = [t.name for t in found.structure.terms]
    named = [
        p for t in candidates(taken, axes) if not t.effect.formal for p in probes(t, problem.data.V)
    ]
    here = evaluate(problem, o.theta, o.noise, whole=False)
    return [p.name for p in named], Screen(problem, o.theta, here, named).D


def similarity(
    named: tuple[list[str], np.ndarray],
    at: Pass,
    trace: np.ndarray,
    tangents: np.ndarray,
    A: np.ndarray,
) -> tuple[str, float]:
    """(the nearest named cause, cos) of a ``trace`` (E,), beside ``tangents`` (p, E) held.

    A (p, p) is the information of what is held, priors included.
    """
    names, D = named
    D = np.vstack([trace, D])
    across = (D * at.w) @ tangents.T
    own = np.einsum("ij,j,ij->i", D, at.w, D)
    left = own - np.einsum("ij,ij->i", across, np.linalg.solve(A, across.T).T)
    with_it = (D * at.w) @ trace - across @ np.linalg.solve(A, across[0])
    told = left > 1e-6 * np.maximum(own, 1e-30)
    with np.errstate(invalid="ignore", divide="ignore"):
        cos = np.abs(np.where(told, with_it / np.sqrt(left[0] * left), 0.0))[1:]
    best = int(np.argmax(cos))
    return names[best], float(cos[best])
