"""Compute the log-likelihood's score and information, and its derivatives with respect to noise.

    g = ∂ℓ/∂θ,   H = Σ w ∂c ∂cᵀ,   s_i = ∂ℓ/∂ ln a_i ≈ (ℓ_i(a e^δ) − ℓ_i(a e^−δ)) / 2δ

ℓ is the filter's log-likelihood (`heli3dof.identification.greybox.likelihood`), ℓ_i its part of
axis i. θ (n,) are the scaled parameters, a_i is the process noise of axis i. H is a sum over the
encoder readings: c is the prediction of a reading, ∂c its gradient with respect to θ, w its
information. The step δ = `PROBE` is large, because the likelihood is rough at smaller scales.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from heli3dof.identification.bias_correction.perturbation import (
    MOVES_THRUST,
    Path,
    forcing,
    forward,
    path,
)
from heli3dof.identification.greybox.likelihood import (
    DIFFERENCE,
    Likelihood,
    diverged,
    score_and_information,
)
from heli3dof.identification.greybox.maximum_likelihood import PROBE
from heli3dof.model.estimation.ekf_quantised import FilterRun
from heli3dof.model.physics.state_layout import Stage
from heli3dof.parallel import parallel_map

SCANNED = {"mass.change.time_s": 5e-3}
"""Parameter → step of its finite difference, in the scaled parameter (5e-3 is 0.05 s), in place of
`DIFFERENCE`. Steps are chosen. The likelihood has many local maxima in these parameters. So score
tests at a grid of values (`bias_correction.scans`) set them. Bias-corrected fits keep them."""


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Derivatives of the log-likelihood ℓ with respect to n scaled parameters θ and the noise.

    ``g`` is the score ∂ℓ/∂θ, and ``H`` is the information matrix of θ. ``slope`` and ``curvature``
    are the derivatives of ℓ with respect to the noise. The other fields are large arrays from the
    Kalman filter's run over E encoder readings. `evaluate` computes ``g`` and ``H`` from them.
    """

    g: np.ndarray
    """(n,) score, without the prior"""
    H: np.ndarray
    """(n, n) information, without the prior"""
    slope: np.ndarray
    """(3,) first derivatives of ℓ with respect to the logarithms of the noise intensities"""
    curvature: np.ndarray
    """(3,) second derivatives of ℓ with respect to the logarithms of the noise intensities"""
    at: FilterRun
    path: Path
    T: np.ndarray
    """(n, E) tangents ∂c/∂θ"""


def evaluate(
    problem: Likelihood,
    theta: np.ndarray,
    noise: np.ndarray,
    *,
    with_noise_derivatives: bool = True,
) -> Evaluation:
    """Return the log-likelihood's derivatives at ``theta`` and ``noise``.

    ``theta`` (n,) are scaled parameters. ``noise`` (4,) is the process noise of roll, pitch and yaw
    (rad/s²/√Hz), then the sampling jitter (s). Without ``with_noise_derivatives``, the derivatives
    with respect to the noise are not computed. Their fields are then 0 (first derivatives) and −1
    (second derivatives).
    """
    factor = np.array([np.exp(PROBE)] * 3 + [1.0])

    def centre() -> Evaluation:
        at = problem.run(theta, noise, keep=2)
        p = path(problem.structure, problem.values(theta), problem.data, at)
        T = tangents(problem, theta, p)
        g, H = score_and_information(at, T)
        return Evaluation(g, H, np.zeros(3), np.full(3, -1.0), at, p, T)

    def part(i: int) -> Any:
        if i == 0:
            return centre()
        return problem.loglik(theta, noise * factor if i == 1 else noise / factor)

    if not with_noise_derivatives:
        return centre()
    result: Evaluation
    result, up, down = parallel_map(part, 3)
    mid = result.at.loglik
    finite = np.isfinite(up) & np.isfinite(mid) & np.isfinite(down)
    up, mid, down = (np.where(finite, each, 0.0) for each in (up, mid, down))
    curvature = np.where(finite, (up - 2 * mid + down) / PROBE**2, -1.0)
    return replace(result, slope=(up - down) / (2 * PROBE), curvature=curvature)


def efficient_score(
    problem: Likelihood, theta: np.ndarray, e: Evaluation, *, prior: bool
) -> np.ndarray:
    """Return weights q (E,): a change δc (E,) of the predicted readings has the score q·δc.

    The score is the derivative of the log-likelihood in the direction δc, without the part that a
    change of the fitted parameters ``theta`` (n,) can explain (the efficient score). If ``prior``
    is True, the gradient of the log prior is added to the score of ``theta``. Use True for
    recordings, and False for null simulations (simulated flights of the fitted model).
    """
    g = e.g - problem.prior_precision * (theta - problem.prior_mean) if prior else e.g
    newton_step = np.linalg.solve(e.H + np.diag(problem.prior_precision), g)
    return np.asarray(e.at.g - e.at.w * (newton_step @ e.T))


def fixed_parameters(problem: Likelihood) -> np.ndarray:
    """Return (n,) bool: True for the parameters in `SCANNED`.

    A bias-corrected fit keeps these parameters at their start values.
    """
    return np.array([f.name in SCANNED for f in problem.structure.free])


def tangents(problem: Likelihood, theta: np.ndarray, p: Path) -> np.ndarray:
    """Return the derivatives ∂c/∂θ (n, E) of the filter's E predicted readings c.

    Row j contains the derivatives with respect to parameter j of ``theta`` (n,).
    `bias_correction.perturbation` computes it along the filter's states ``p``. In two cases,
    `Likelihood.tangents` computes it by simulation instead:

    - Parameter j belongs to an effect that changes the encoder readings (`Stage.MEASURE`). Backlash
      is such an effect.
    - The perturbation diverges. Negative dry friction can cause this.
    """
    s = problem.structure
    by_name = {t.name: t for t in s.terms}
    changes_readings = np.array(
        [f.term is not None and Stage.MEASURE in by_name[f.term].effect.hooks for f in s.free]
    )
    changes_thrust = [
        f.term is not None and bool(MOVES_THRUST & set(by_name[f.term].effect.hooks))
        for f in s.free
    ]
    out = np.zeros((len(theta), len(p.at.row)))
    perturbed = np.flatnonzero(~changes_readings)
    _, high = problem.bounds
    step = np.array([SCANNED.get(f.name, DIFFERENCE) for f in s.free])
    step = np.where(theta + step > high, -step, step)
    sets = [problem.values(theta + e) for e in np.diag(step)[perturbed]]
    a = forcing(p, s, sets, [changes_thrust[j] for j in perturbed])
    with np.errstate(over="ignore", invalid="ignore"):
        out[perturbed] = forward(p, a / step[perturbed, None, None])
    simulated = changes_readings | diverged(out)
    if simulated.any():
        out[simulated] = problem.tangents(theta, p.at, np.flatnonzero(simulated))
    return out
