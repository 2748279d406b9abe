"""Project a fit's parameters out of the changes that another cause makes to the predictions."""

from __future__ import annotations

import numpy as np


def project_out(
    D: np.ndarray, tangents: np.ndarray, A: np.ndarray, w: np.ndarray | float = 1.0
) -> np.ndarray:
    """Return D̃ (K, E) or (E,): D without the part that the fit's parameters can produce.

        D̃ = D − (T w Dᵀ)ᵀ A⁻¹ T,        D w D̃ᵀ = D w Dᵀ − Xᵀ A⁻¹ X,      X = T w Dᵀ

    D are the changes of E predictions by K causes, T = ``tangents`` (p, E) those per unit of
    each of p parameters, w (E,) the predictions' information. D w D̃ᵀ is the part of the
    information D w Dᵀ that remains. D̃ w D̃ᵀ is smaller in general, because A (p, p) = T w Tᵀ + Λ
    includes the prior's information Λ. With predictions in rad, w is in 1/rad² and D in rad per
    unit of its cause.
    """
    return np.asarray(D - np.linalg.solve(A, (tangents * w) @ D.T).T @ tangents)
