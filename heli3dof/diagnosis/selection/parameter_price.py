"""Compute the BIC penalty of a term's parameters, reduced by prior information.

The penalty is subtracted from the term's score 2 Δℓ. With N encoder events, the first parameter
costs ln N, and each further one

    min(ln N, ln(σ₀²/σ²)),      at least 0

by Laplace's approximation of the evidence. σ₀² is the parameter's prior variance, σ² its posterior
variance with all other parameters free. A parameter determined only by its prior costs nothing.
"""

from __future__ import annotations

import numpy as np

from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.identification.greybox.maximum_likelihood import Optimum


def price(problem: Likelihood, fit: Optimum, name: str, inflation: float = 1.0) -> float:
    """Return the penalty of the parameters of the term ``name``.

    ``inflation``: variance inflation κ, by which the information is divided.
    """
    at = [i for i, f in enumerate(problem.structure.free) if f.term == name]
    most = float(np.log(max(len(fit.at.row), 2)))
    if len(at) < 2:
        return len(at) * most
    prior = problem.prior_precision
    P = fit.information / inflation + np.diag(prior)
    log_shrinkage = np.log(1.0 / (prior * np.diag(np.linalg.pinv(P, hermitian=True))))
    return most + float(np.clip(log_shrinkage[at[1:]], 0.0, most).sum())
