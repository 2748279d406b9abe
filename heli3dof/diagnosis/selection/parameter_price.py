"""What a term's numbers cost, of a score 2 Δℓ: ln N for its size, and for another number


    min(ln N, ln(σ₀²/σ²)),

σ₀² its prior's variance, σ² that of the estimate (beside all others, the prior taken in): the
evidence's price (Laplace) of a number that was known before to within σ₀. A step in roll does not
tell at which power of the thrust an inflow's loss grows; then that number buys nothing, and costs
nothing either. Where a prior is so wide that it was chosen only to keep the fit finite, ln N (the
readings) is the lesser.
"""

from __future__ import annotations

import numpy as np

from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.identification.greybox.maximum_likelihood import Optimum


def price(problem: Likelihood, fit: Optimum, name: str, inflation: float = 1.0) -> float:
    """Of the numbers of the term ``name`` in this fit; ``inflation``: κ, of its likelihood."""
    at = [i for i, f in enumerate(problem.structure.free) if f.term == name]
    most = float(np.log(max(len(fit.at.row), 2)))
    if len(at) < 2:
        return len(at) * most
    prior = problem.prior_precision
    P = fit.information / inflation + np.diag(prior)
    told = np.log(1.0 / (prior * np.diag(np.linalg.pinv(P, hermitian=True))))
    return most + float(np.clip(told[at[1:]], 0.0, most).sum())
