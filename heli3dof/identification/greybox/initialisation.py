"""Choose initial values of parameters whose likelihood is flat at the nominal value.

An example is ``encoder.backlash``. A filter without backlash explains backlash as process noise. So
the likelihood has no slope at zero backlash, and can have several maxima. `likeliest_start`
therefore evaluates the likelihood at each value that the effect lists in ``starts``. At each value
it first updates the process noise.
"""

from __future__ import annotations

import numpy as np

from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.identification.greybox.maximum_likelihood import NOISE_START, better_noise

SETTLING = 3
"""Number of noise updates at each value, before the likelihood is evaluated there"""


def likeliest_start(
    problem: Likelihood, theta: np.ndarray, noise: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return the scaled parameters (n,) and the noise (4,) from which a fit should start.

    The parameters are ``theta``, except the first parameter of each effect that lists values in
    ``starts``: it gets the likeliest among these values and its value in ``theta``. The noise is
    process noise on roll, pitch, yaw (rad/s²/√Hz) and jitter (s).
    """
    a = np.array(NOISE_START if noise is None else noise, dtype=float)
    theta = theta.copy()
    for term in problem.structure.terms:
        if not term.effect.starts:
            continue
        j = problem.structure.names.index(f"{term.name}.{term.effect.parameters[0].name}")
        best, chosen = -np.inf, theta[j]
        settled = a
        for start in (
            theta[j],
            *(problem.structure.free[j].scaled(v) for v in term.effect.starts),
        ):
            theta[j] = start
            loglik, a = _at(problem, theta, a)
            if loglik > best:
                best, chosen, settled = loglik, start, a
        theta[j], a = chosen, settled
    return theta, a


def _at(problem: Likelihood, theta: np.ndarray, a: np.ndarray) -> tuple[float, np.ndarray]:
    for _ in range(SETTLING):
        a, _ = better_noise(problem, theta, a, problem.data.axes)
    return float(problem.run(theta, a, keep=0).loglik.sum()) + problem.log_prior(theta), a
