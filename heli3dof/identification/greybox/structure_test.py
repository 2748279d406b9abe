"""Is the rig one by simplified equations? A look, and a second fit only where it pays.

With θ̂ the fit of the whole body, C the tangents of the shares a that may be left out of its
equations (`heli3dof.model.effects.simplified_couplings` and the constant yaw inertia), g their
score and A the fit's information, priors included, leaving out a is worth to second order

    Δℓ(a) = a·g − ½ aᵀ V a,      V = H_aa − H_aθ A⁻¹ H_θa

Equations hold a term or they do not: a is all or nothing. Where the best of the three ways pays
more than `SURE` times κ, what the scores scatter more than the noise model allows, the rig is
fitted so, and taken so where that fit bears it out by as much.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from heli3dof.identification.greybox.estimate import Estimate, estimate
from heli3dof.identification.greybox.likelihood import score_and_information
from heli3dof.model.effects import terms
from heli3dof.model.physics.parametrisation import Structure

WAYS = ("simplified.couplings", "simplified.yaw_inertia")
ALL = (np.array([1.0, 0.0]), np.array([0.0, 1.0]), np.array([1.0, 1.0]))
SURE = 6.0
"""Of the log-likelihood: odds of four hundred to one"""


def as_written(found: Estimate) -> Estimate:
    """The fit, or that of simplified equations where the recordings ask for them."""
    g, V = left_out(found)
    worth = [float(a @ g - 0.5 * a @ V @ a) for a in ALL]
    best = int(np.argmax(worth))
    if not worth[best] > SURE * found.inflation:
        return found
    names = [n for n, a in zip(WAYS, ALL[best], strict=True) if a]
    own = found.structure
    simpler = replace(found.problem, structure=Structure(own.profile, (*own.terms, *terms(names))))
    start = np.append(found.theta, simpler.prior_mean[len(found.theta) :])
    second = estimate(simpler, start=start, noise=found.optimum.noise)
    won = second.optimum.loglik - found.optimum.loglik
    return second if won > SURE * max(found.inflation, second.inflation) else found


def left_out(found: Estimate) -> tuple[np.ndarray, np.ndarray]:
    """(2,) g and (2, 2) V, in whole shares."""
    o, n, own = found.optimum, len(found.theta), found.structure
    wide = replace(found.problem, structure=Structure(own.profile, (*own.terms, *terms(WAYS))))
    theta = np.append(o.theta, np.zeros(len(WAYS)))
    new = wide.structure.free[n:]
    C = wide.tangents(theta, o.at, np.arange(n, n + len(WAYS)))
    C *= np.array([[f.inward(1.0) - f.inward(0.0)] for f in new])
    g, H = score_and_information(o.at, np.vstack([o.tangents, C]))
    A = H[:n, :n] + np.diag(found.problem.prior_precision)
    pull = g[:n] - found.problem.prior_precision * (o.theta - found.problem.prior_mean)
    across = np.linalg.solve(A, H[:n, n:])
    return g[n:] - across.T @ pull, H[n:, n:] - H[n:, :n] @ across
