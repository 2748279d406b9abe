"""Test whether simplified equations of motion describe the rig better than the full ones.

Two parts of the equations can be omitted: the inertia couplings (effect ``simplified.couplings``)
and the variation of the yaw inertia with the angles (effect ``simplified.yaw_inertia``). Let a (2,)
be the omitted share of each part, and θ the parameters. g is the log-likelihood's gradient with
respect to a, at the fit θ̂ of the full equations. H is the information of (θ, a); A is H_θθ plus the
prior's precision. To second order, omitting the shares a raises the log-likelihood by

    Δℓ(a) = a·g − ½ aᵀ V a,      V = H_aa − H_aθ A⁻¹ H_θa

Each share is 0 or 1, so there are three combinations with an omission. κ is the ratio of the
scores' actual variance to the variance that the noise model expects. If the largest Δℓ exceeds
`REQUIRED_GAIN` × κ, these simplified equations are fitted. They replace the full ones if the fit
actually raises the log-likelihood by more than `REQUIRED_GAIN` × κ.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from heli3dof.identification.greybox.estimate import Estimate, estimate
from heli3dof.identification.greybox.likelihood import score_and_information
from heli3dof.model.effects import terms

SIMPLIFICATIONS = ("simplified.couplings", "simplified.yaw_inertia")
COMBINATIONS = (np.array([1.0, 0.0]), np.array([0.0, 1.0]), np.array([1.0, 1.0]))
REQUIRED_GAIN = 6.0
"""Required increase of the log-likelihood, as a multiple of the scatter factor κ. An increase of 6
means odds of e⁶ = 400 to 1."""


def with_simplifications(found: Estimate) -> Estimate:
    """Return a fit with simplified equations of motion if it is far likelier, else ``found``.

    ``found`` is the fit with the full equations. Far likelier means: the log-likelihood is higher
    by more than `REQUIRED_GAIN` · κ. κ is `Estimate.inflation`, which is 1 for white noise.
    """
    g, V = score_and_curvature(found)
    worth = [float(a @ g - 0.5 * a @ V @ a) for a in COMBINATIONS]
    best = int(np.argmax(worth))
    if not worth[best] > REQUIRED_GAIN * found.inflation:
        return found
    names = [n for n, a in zip(SIMPLIFICATIONS, COMBINATIONS[best], strict=True) if a]
    simpler = replace(found.problem, structure=found.structure.with_terms(*terms(names)))
    start = np.append(found.theta, simpler.prior_mean[len(found.theta) :])
    second = estimate(simpler, start=start, noise=found.optimum.noise)
    gain = second.optimum.loglik - found.optimum.loglik
    return second if gain > REQUIRED_GAIN * max(found.inflation, second.inflation) else found


def score_and_curvature(found: Estimate) -> tuple[np.ndarray, np.ndarray]:
    """Return gradient g (2,) and curvature V (2, 2) of the log-likelihood with respect to a.

    a (2,) are the omitted shares of two parts of the equations of motion: the inertia couplings,
    and the variation of the yaw inertia. The fit ``found`` has the full equations, a = 0. g and V
    are those at a = 0, if the other parameters are fitted again for each a.
    """
    o, n = found.optimum, len(found.theta)
    wide = replace(found.problem, structure=found.structure.with_terms(*terms(SIMPLIFICATIONS)))
    theta = np.append(o.theta, np.zeros(len(SIMPLIFICATIONS)))
    new = wide.structure.free[n:]
    C = wide.tangents(theta, o.at, np.arange(n, n + len(SIMPLIFICATIONS)))
    C *= np.array([[f.scaled(1.0) - f.scaled(0.0)] for f in new])
    g, H = score_and_information(o.at, np.vstack([o.tangents, C]))
    A = H[:n, :n] + np.diag(found.problem.prior_precision)
    pull = g[:n] - found.problem.prior_precision * (o.theta - found.problem.prior_mean)
    across = np.linalg.solve(A, H[:n, n:])
    return g[n:] - across.T @ pull, H[n:, n:] - H[n:, :n] @ across
