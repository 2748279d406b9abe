"""Rao's score test of one candidate effect against a fitted model, by one linearisation."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.likelihood import score_and_information
from heli3dof.model.effects import Term


@dataclass(frozen=True)
class ScoreTestResult:
    """The result of `score_test` for one candidate effect: its score and estimated parameters."""

    name: str
    score: float
    """Twice the increase of the log-likelihood when all parameters are refitted, to second order,
    divided by the scatter factor κ (`Estimate.inflation`). If the rig lacks the effect, the score
    follows χ²; the degrees of freedom are the number of the effect's parameters."""
    values: tuple[float, ...]
    """The estimate of one Gauss–Newton step, in the parameters' units."""


def score_test(found: Estimate, term: Term) -> ScoreTestResult:
    """Test by Rao's score test whether the model of the fit ``found`` lacks the effect ``term``.

    The test takes one linearisation and no fit: 10 ms per parameter for 60 s of flight. The
    linearisation point is the parameter value at which the effect is absent. A logarithmic
    parameter has no such value, so its starting value is used. The score means little for an
    effect that changes nothing to first order at this point (`motor.saturation`).
    """
    wider = found.structure.with_terms(term)
    problem = replace(found.problem, structure=wider)
    o = found.optimum
    old = len(o.theta)
    theta = np.concatenate(
        [o.theta, [f.scaled(f.start if f.log else f.null) for f in wider.free[old:]]]
    )
    new = np.arange(old, len(theta))
    D = np.vstack([o.tangents, problem.tangents(theta, o.at, new)])
    g, H = score_and_information(o.at, D)
    A = H + np.diag(problem.prior_precision)
    g[:old] = 0.0  # the fitted parameters are at their optimum
    inverse = np.linalg.inv(A)[np.ix_(new, new)]
    step = inverse @ g[new]
    score = float(g[new] @ step) / found.inflation
    values = problem.values(np.concatenate([o.theta, theta[new] + step]))[old:]
    return ScoreTestResult(term.name, score, tuple(float(v) for v in values))
