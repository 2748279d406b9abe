"""Test each axis for a residual torque: a torque that the fitted model lacks.

The torque is a free function of one variable z: f(z) = Σ_j τ_j φ_j(z). z is an angle, a rate, a
voltage, a product of these, or the time. The φ_j are hat (triangular) functions with coefficients
τ_j in N·m (`unmodelled.residual_torque`). The `KNOTS` hat functions of one variable on one axis
form a group. Rao's score test examines a group without fitting τ. Its statistic is

    S = uᵀ V⁺ u − (1ᵀu)²/(1ᵀV1),        S ~ χ²(r) if there is no residual torque

Here u_j = ∂ ln L/∂τ_j are the scores, with the likelihood L. V is the Fisher information matrix of
τ, and V⁺ is its pseudo-inverse. The fit's parameters are projected out of u and V. The second
summand removes the constant torque; r degrees of freedom remain. The search has four steps:

1. Simulate flights without residual torque (null simulations). The mean of u in these flights is
   the filter's bias; subtract it from u. The factor κ corrects the scale of S. It is the mean of
   S/r in these flights, but at least 1 and at least the fit's variance inflation
   (`Estimate.inflation`).
2. Compute the significance x = −2 ln P(χ²_r > S/κ) of each group. It is comparable between groups
   with different r. A Gumbel distribution is fitted to the largest x of each null simulation. The
   threshold of x is the value that this distribution exceeds with the probability
   `TORQUE_FALSE_ALARMS`.
3. Accept a group that meets both conditions:

   - Its x exceeds the threshold, even if S/κ is replaced by S/(κρ). ρ ≥ 1 is the factor by which
     coloured noise increases S (`torque_evidence.coloured_noise_ratio`).
   - Its torque explains more than `MIN_VARIANCE_SHARE` of the variance of the axis's residual
     torque.

   If several groups meet them, accept the one with the largest x. In this comparison, `TIE` is
   added to the x of functions of time.
4. Project the accepted torque out of all scores, and test again.

A torque that depends on time only is slow noise, such as the torque of a draught. Step 4 projects
it out, but the model gets no term for it. At first, step 3 sets ρ = 1 (white noise) unless the
estimate of ρ is significantly larger than 1. As soon as the search has accepted slow noise, the
noise is known to be coloured. From then on, step 3 uses each estimate of ρ as it is.

If flights cannot be simulated, κ is estimated from the scores in half-second blocks of the flight.
The threshold of x is then twice the Bonferroni threshold.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.constants import MAX_COMPARED, TIE
from heli3dof.diagnosis.search.nulls import gumbel, gumbel_factor
from heli3dof.diagnosis.unmodelled.residual_torque import (
    Hats,
    HatScores,
    LinearisedRun,
    hat_scores,
    hat_sensitivities,
)
from heli3dof.diagnosis.unmodelled.torque_evidence import (
    LIKE,
    RANK_TOLERANCE,
    Evidence,
    Nuisance,
    Scores,
    coloured_noise_ratio,
    informative_directions,
    named_traces,
    scores_in_blocks,
    similarity,
)
from heli3dof.distributions import chi2_logsf
from heli3dof.identification.bias_correction.coloured_noise import CHANCE
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.model.effects.empirical import KNOTS

if TYPE_CHECKING:
    from heli3dof.diagnosis.result import TorqueTerm

ALTERNATIVE_SHARE = 0.5
"""Share of the best variable's x from which a variable is reported as alternative. Chosen."""
MIN_VARIANCE_SHARE = 0.05
"""Least share of the variance: a limit cycle may be significant, yet explain nothing. Chosen."""
TORQUE_FALSE_ALARMS = 0.0005
"""Probability of a false residual torque in a search. Chosen low; the threshold that it requires is
extrapolated from few nulls."""
THRESHOLD_SCALES = gumbel_factor(TORQUE_FALSE_ALARMS)
"""Distance of the threshold from the location of the Gumbel distribution, in scales"""
LIKE_SUFFIX = "-like"  # of an effect that a torque resembles, but that is not confirmed
WINDOW_S = 0.1
"""s, over which torques are averaged. Chosen; not derived."""


class TorqueLocation(NamedTuple):
    """The axis on which a torque acts, and the variable of which it is a function."""

    axis: str
    variable: str


@dataclass(frozen=True, eq=False)
class ResidualTorque:
    """A torque on ``axis`` that the fitted model lacks, as a function of ``depends_on``."""

    axis: str
    depends_on: str
    """One of `unmodelled.residual_torque.UNITS`"""
    share: float
    """Explained share of the variance of the axis's residual torque, averaged over `WINDOW_S`"""
    table: tuple[tuple[float, float], ...]
    """Rows (variable in SI units, torque in N·m without its mean)"""
    std: tuple[float, ...]
    """N·m, standard deviations of the table's torques"""
    score: float
    """x of the module docstring"""
    confidence: float
    """1 minus the probability of so large a score without a residual torque"""
    also: tuple[str, ...] = ()
    """Other variables that explain almost as much, by falling x"""
    resembles: str | None = None
    """A cause with nearly the same trace, as ``friction.viscous.yaw-like``"""
    term: TorqueTerm | None = None
    """The term of the extended model for this torque, if any"""

    @property
    def likely_effect(self) -> str | None:
        """Return the name of the cause in ``resembles``, as ``friction.viscous.yaw``."""
        return None if self.resembles is None else self.resembles.removesuffix(LIKE_SUFFIX)

    @property
    def is_slow_noise(self) -> bool:
        """Return True if the torque depends on time only, as the torque of a draught does."""
        return self.depends_on == "time"

    @property
    def size_Nm(self) -> float:
        """Return the root mean square of the torques in ``table``, N·m."""
        return float(np.sqrt(np.mean([torque**2 for _, torque in self.table])))


def split_off_slow_noise(
    torques: Sequence[ResidualTorque],
) -> tuple[tuple[ResidualTorque, ...], tuple[ResidualTorque, ...]]:
    """Split residual torques into functions of a measured variable, and functions of time.

    Functions of time are slow noise, which no model can predict.
    """
    return (
        tuple(t for t in torques if not t.is_slow_noise),
        tuple(t for t in torques if t.is_slow_noise),
    )


def significant_torques(
    evidence: Evidence, proven: TorqueLocation | None = None
) -> tuple[ResidualTorque, ...]:
    """Return the significant residual torques, in the order in which the search accepted them.

    Each is a function of one measured variable, or of time. ``proven``: axis and variable of a
    torque that another test has shown to exist (`torque_formula.significant_formula`). The search
    accepts this torque first, without a test.
    """
    fit, flight, library = evidence.fit, evidence.flight, evidence.library
    null, nuisance = evidence.null, evidence.nuisance
    named: tuple[list[str], np.ndarray] | None = None
    out: list[ResidualTorque] = []
    while sum(not torque.is_slow_noise for torque in out) < MAX_COMPARED:
        sums = hat_scores(library, flight, nuisance.tangents)
        tests = score_tests(fit, flight, library, sums, nuisance, null)
        if proven is not None and not out:
            q = _group(library, tests, proven)
            new, D = _residual_torque(flight, library, tests, q), _sensitivities(evidence, q)
        else:
            is_coloured = any(torque.is_slow_noise for torque in out)
            accepted = _next_torque(evidence, nuisance, tests, is_coloured=is_coloured)
            if accepted is None:
                break
            q, new, D = accepted
        change = np.array([torque for _, torque in new.table]) @ D
        if named is None:
            named = named_traces(fit)
        name, cos = similarity(named, flight.at, change, nuisance.tangents, nuisance.A)
        out.append(replace(new, resembles=f"{name}{LIKE_SUFFIX}") if cos > LIKE else new)
        columns = np.r_[library.columns(q)]
        nuisance = nuisance.with_torque(flight, D, tests.directions[q], columns, null)
    return tuple(out)


def _next_torque(
    evidence: Evidence, nuisance: Nuisance, tests: ScoreTests, *, is_coloured: bool
) -> tuple[int, ResidualTorque, np.ndarray] | None:
    """Return (index of a group, its torque, its sensitivities) of the next torque to accept.

    A group contains the hat functions of one variable on one axis. The result is None if no group
    meets both conditions:

    - Its significance exceeds the threshold, with coloured noise too (`_exceeds_coloured_noise`).
    - Its torque explains more than `MIN_VARIANCE_SHARE` of the variance of the axis's residual
      torque.

    If several groups meet them, the result is the most significant one. In this comparison,
    functions of time get a bonus (`ranked_with_time_bonus`). The sensitivities (KNOTS, E) are the
    derivatives of the E predicted encoder readings with respect to the coefficients of the torque.
    ``is_coloured``: True if the search has already accepted slow noise, that is, a torque that
    depends on time only.
    """
    significant = [int(q) for q in np.argsort(-tests.x) if tests.x[q] > tests.threshold]
    for q in ranked_with_time_bonus(significant, evidence.library, tests.x):
        torque = _residual_torque(evidence.flight, evidence.library, tests, q)
        if torque.share > MIN_VARIANCE_SHARE:
            D = _sensitivities(evidence, q)
            if _exceeds_coloured_noise(
                evidence, nuisance, tests, q, torque, D, is_coloured=is_coloured
            ):
                return q, torque, D
    return None


def _sensitivities(evidence: Evidence, group: int) -> np.ndarray:
    """Return derivatives (KNOTS, E) of E predicted readings with respect to torque coefficients.

    The torque acts on one axis and is a piecewise linear function of one variable. The coefficients
    are the torques (N·m) at its `KNOTS` knots. ``group``: index of the axis and the variable.
    """
    return hat_sensitivities(evidence.library, evidence.flight, group)


def _group(library: Hats, tests: ScoreTests, location: TorqueLocation) -> int:
    """Return the index of the hat functions for a torque's axis and variable, ``location``.

    The result is the index of a group: the hat functions of one variable on one axis. A variable
    that hardly changes in the flight has no group. In that case, the result is the most significant
    group of the axis.
    """
    groups = [q for q, (i, _) in enumerate(library.groups) if AXES[i] == location.axis]
    exact = [q for q in groups if library.groups[q][1] == location.variable]
    return max(exact or groups, key=lambda q: float(tests.x[q]))


def ranked_with_time_bonus(groups: Sequence[int], library: Hats, x: np.ndarray) -> list[int]:
    """Return ``groups``, sorted by falling significance; functions of time get the bonus `TIE`.

    A group is a residual torque on one axis, as a function of one variable. ``groups`` contains the
    indices of the groups to sort, and ``x`` the significance of every group. A function of time
    describes slow noise, for example the torque of a draught. Before sorting, `TIE` is added to its
    significance. So a function of another variable precedes a function of time only if it is more
    significant by more than `TIE`.
    """

    def key(q: int) -> float:
        return float(x[q]) + (TIE if library.groups[q][1] == "time" else 0.0)

    return sorted(groups, key=key, reverse=True)


def _exceeds_coloured_noise(
    evidence: Evidence,
    nuisance: Nuisance,
    tests: ScoreTests,
    q: int,
    new: ResidualTorque,
    D: np.ndarray,
    *,
    is_coloured: bool,
) -> bool:
    """Return whether the torque ``new`` would still be significant if the noise were coloured.

    ``new`` is a function of one variable on one axis; ``q`` is the index of this axis and variable.
    S is the score-test statistic of the torque. κ ≥ 1 is the variance inflation of its score, and
    ρ ≥ 1 is the factor by which coloured noise increases S. The torque is significant if
    x = −2 ln P(χ² > S/(κρ)) exceeds the threshold of the search.

    Usually, ρ = 1 unless its estimate is significantly larger than 1. If ``is_coloured`` is True,
    each estimate of ρ is used as it is: the search has already found slow noise, so the noise is
    known to be coloured.
    """
    P = tests.directions[q]
    torque = np.array([f for _, f in new.table])
    chance = 1.0 if is_coloured else CHANCE
    white = float(tests.white[q])
    rho = coloured_noise_ratio(evidence.flight, nuisance, D, P, torque, white, chance)
    S = float(_statistic(tests.u[q] @ P, P.T @ tests.V[q] @ P)[0])
    x = float(minus_2_log_p(np.array(S / tests.kappa[q] / rho), P.shape[1]))
    return x > tests.threshold


@dataclass(frozen=True, eq=False)
class ScoreTests:
    """Results of the score tests of all groups of hat functions.

    A group contains the hat functions of one variable on one axis.
    """

    x: np.ndarray
    """(groups,) −2 ln P(χ²_r > S/κ)"""
    threshold: float
    """Threshold of x"""
    location: float
    scale: float
    """Location and scale of the Gumbel distribution"""
    u: np.ndarray
    """(groups, KNOTS) scores"""
    V: np.ndarray
    """(groups, KNOTS, KNOTS) information"""
    kappa: np.ndarray
    """(groups,) κ, at least 1"""
    white: np.ndarray
    """(groups,) mean S/r of the nulls, which may be below 1; 1 without nulls"""
    directions: tuple[np.ndarray, ...]
    """(KNOTS, r) each: informative directions"""


def score_tests(
    fit: Estimate,
    flight: LinearisedRun,
    library: Hats,
    sums: HatScores,
    nuisance: Nuisance,
    null: Scores | None,
) -> ScoreTests:
    """Return the score tests of all groups; a group is the hat functions of a variable on an axis.

    ``sums``: scores and information of the recorded flight (`hat_scores`). ``null``: scores in
    flights simulated without residual torque. The function calibrates the test with them: it
    computes the threshold and a factor κ. In theory, the test statistic S without residual torque
    has a χ² distribution. κ (at least 1) is the factor by which the mean of S in the simulated
    flights exceeds the mean of this distribution.

    If ``null`` is None, κ is computed from blocks of the recorded flight. The threshold is then
    twice the Bonferroni threshold, because the bias of the scores is unknown.
    """
    groups = len(library.groups)
    X = np.linalg.solve(nuisance.A, sums.cross)
    u = (sums.u - X.T @ nuisance.g).reshape(groups, KNOTS)
    if null is not None:
        un = (null.u - nuisance.g_null @ X).reshape(-1, groups, KNOTS)
        B = len(un)
        mean = un.mean(axis=0)
        u = u - mean
        # From each null, the mean of the other nulls is subtracted.
        centred = (un - mean) * B / (B - 1)
    else:
        blocks = scores_in_blocks(flight, library, nuisance.tangents)
        ub = (blocks.u - blocks.g @ X).reshape(-1, groups, KNOTS)
        centred = ub - ub.mean(axis=0)
    V = np.empty((groups, KNOTS, KNOTS))
    x, kappa, white = np.zeros(groups), np.ones(groups), np.ones(groups)
    x_null = np.zeros((len(centred), groups))
    directions = []
    for q in range(groups):
        c = library.columns(q)
        V[q] = sums.V[q] - sums.cross[:, c].T @ X[:, c]
        V[q], off = _without_constant(V[q], sums.V[q])
        u[q], centred[:, q] = off @ u[q], centred[:, q] @ off.T
        E = informative_directions(V[q], sums.V[q])
        directions.append(E)
        rank = E.shape[1]
        if rank == 0:
            continue
        V_E = E.T @ V[q] @ E
        S = _statistic(u[q] @ E, V_E)
        Sn = _statistic(centred[:, q] @ E, V_E)
        if null is not None:
            white[q] = float(Sn.mean()) / rank
            kappa[q] = max(white[q], 1.0)
            x_null[:, q] = minus_2_log_p(Sn / kappa[q], rank)
            kappa[q] = max(kappa[q], fit.inflation)
        else:
            m = len(centred)
            kappa[q] = max(float(Sn.sum()) / rank * m / (m - 1), 1.0)
        x[q] = minus_2_log_p(S / kappa[q], rank)[0]
    if null is not None:
        largest = x_null.max(axis=1)
        location, scale = gumbel(largest, least=2.0)
        scale *= gumbel_stretch(len(largest))
        threshold = location + scale * THRESHOLD_SCALES
    else:
        location, scale = 4 * float(np.log(max(groups, 1))), 4.0
        threshold = -4 * float(np.log(TORQUE_FALSE_ALARMS / max(groups, 1)))
    return ScoreTests(x, threshold, location, scale, u, V, kappa, white, tuple(directions))


def gumbel_stretch(n: int) -> float:
    """Return the factor by which to stretch a Gumbel scale estimated from n null flights.

    With the stretch, a further flight exceeds the threshold with the probability
    `TORQUE_FALSE_ALARMS`. Without it, the probability is three times (n = 24) or twelve times
    (n = 8) as large. The factor is accurate to 2 % for n ≥ 8.
    """
    return 1 + 4.5 / n + 10 / n**2


def _without_constant(V: np.ndarray, full: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (V′, P), with which a score test ignores a constant torque.

    The test has a torque with `KNOTS` coefficients. u are their scores, the derivatives of ln L,
    and V is their information matrix. If all coefficients are equal, the torque is constant. The
    projected scores P u do not depend on a constant torque, and V′ is their information matrix.
    With the vector 1 of ones,

        V′ = V − V 1 1ᵀ V/(1ᵀ V 1),        P = I − V 1 1ᵀ/(1ᵀ V 1)

    If the fit has a parameter for a constant torque, V contains no information on it, and
    1ᵀ V 1 ≈ 0. The result is then V and the identity I. 1ᵀ V 1 counts as zero if it is tiny
    compared with the trace of ``full``. ``full`` is the information matrix before the fit's
    parameters were projected out.
    """
    one = np.ones(KNOTS)
    along = V @ one
    total = float(one @ along)
    if total <= RANK_TOLERANCE * float(np.trace(full)):  # already projected out
        return V, np.eye(KNOTS)
    return V - np.outer(along, along) / total, np.eye(KNOTS) - np.outer(along, one) / total


def _statistic(u: np.ndarray, V: np.ndarray) -> np.ndarray:
    """Return the score-test statistic uᵀ V⁻¹ u for each row u of scores; V: information."""
    u = np.atleast_2d(u)
    return np.asarray(np.einsum("bi,bi->b", u, np.linalg.solve(V, u.T).T))


def minus_2_log_p(S: np.ndarray, rank: int) -> np.ndarray:
    """Return x = −2 ln P(χ² > S), with ``rank`` degrees of freedom of χ²."""
    return np.asarray(-2 * chi2_logsf(S, rank))


def _residual_torque(
    flight: LinearisedRun, library: Hats, tests: ScoreTests, best: int
) -> ResidualTorque:
    axis, name = library.groups[best]
    E = tests.directions[best]
    inverse = E @ np.linalg.inv(E.T @ tests.V[best] @ E) @ E.T
    torque = inverse @ tests.u[best]
    m = library.variables.index(name)
    below, part = library.knot_positions(flight)
    rows = flight.in_runs & np.isfinite(flight.torque[:, axis])
    at, part = below[rows, m], part[rows, m]
    torque -= float(np.mean(torque[at] * (1 - part) + torque[at + 1] * part))
    f = torque[at] * (1 - part) + torque[at + 1] * part
    std = np.sqrt(tests.kappa[best] * np.diag(inverse))
    alternatives = [q for q in np.argsort(-tests.x) if library.groups[q][0] == axis and q != best]
    least_x = max(ALTERNATIVE_SHARE * float(tests.x[best]), tests.threshold)
    return ResidualTorque(
        AXES[axis],
        name,
        share_of(flight.torque[rows, axis], f, flight.data.h[rows]),
        tuple((float(z), float(v)) for z, v in zip(library.knots[m], torque, strict=True)),
        tuple(float(v) for v in std),
        float(tests.x[best]),
        float(np.exp(-np.exp(-(tests.x[best] - tests.location) / tests.scale))),
        tuple(library.groups[q][1] for q in alternatives if tests.x[q] > least_x),
    )


def share_of(torque: np.ndarray, f: np.ndarray, h: np.ndarray) -> float:
    """Return the share of the variance of ``torque`` (N,) that the function values f (N,) explain.

    The share is max(0, 1 − var(τ̂ − f)/var(τ̂)), where τ̂ is ``torque``. Both τ̂ and f are first
    averaged over time intervals of `WINDOW_S`. ``h`` (N,): sampling intervals in s.
    """
    every = max(1, round(WINDOW_S / float(np.median(h))))
    n = len(f) // every
    mean = torque[: n * every].reshape(n, every).mean(axis=1)
    f = f[: n * every].reshape(n, every).mean(axis=1)
    return float(max(0.0, 1 - np.var(mean - f) / max(np.var(mean), 1e-30)))
