"""Which named cause a free-form torque resembles, in the only sense that counts: what it does.

δ is the leftover's trace in the innovations, δ_p that of a named cause's probe
(`heli3dof.diagnosis.screen`), both with what the fit already holds projected out; with the events'
informations w,

    cos = ⟨δ, δ_p⟩/√(⟨δ, δ⟩⟨δ_p, δ_p⟩),      ⟨a, b⟩ = Σ w a b − (T w a)ᵀ A⁻¹ (T w b)

Above `LIKE` this flight can hardly tell them apart, and the leftover is called "…-like".
"""

from __future__ import annotations

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.catalogue import Probe, candidates, probes
from heli3dof.diagnosis.corrected import look
from heli3dof.diagnosis.screen import Screen
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.likelihood import Pass

LIKE = 0.9


def likeness(
    found: Estimate, at: Pass, trace: np.ndarray, tangents: np.ndarray, A: np.ndarray
) -> tuple[str, float]:
    """(the nearest named cause, cos) of a ``trace`` (E,), beside ``tangents`` (p, E) held.

    A (p, p) is the information of what is held, priors included.
    """
    named = _probes(found)
    problem, o = found.problem, found.optimum
    here = look(problem, o.theta, o.noise, whole=False)
    D = np.vstack([trace, Screen(problem, o.theta, here, named).D])
    across = (D * at.w) @ tangents.T
    gram = (D * at.w) @ D.T - across @ np.linalg.solve(A, across.T)
    own = np.diag(gram)
    told = own > 1e-6 * np.maximum(np.einsum("ij,j,ij->i", D, at.w, D), 1e-30)
    with np.errstate(invalid="ignore", divide="ignore"):
        cos = np.where(told, gram[0] / np.sqrt(own[0] * own), 0.0)[1:]
    best = int(np.argmax(np.abs(cos)))
    return named[best].name, float(abs(cos[best]))


def _probes(found: Estimate) -> list[Probe]:
    d = found.problem.data
    axes = [a for a, there in zip(AXES, d.axes, strict=True) if there]
    taken = [t.name for t in found.structure.terms]
    return [p for t in candidates(taken, axes) for p in probes(t, d.V)]
