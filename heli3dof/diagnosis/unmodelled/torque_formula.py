"""Propose a formula for a residual torque, that is, for a torque that the fitted model lacks.

A formula is a torque c φ on one axis. φ is a measured quantity or a product of two (`PRODUCTS`), c
an unknown coefficient. Rao's score test examines each φ without a fit. Its statistic S, and the
estimate of c with its standard deviation, are

    S = u²/v,    c = u/v ± √(κ/v)

- u: efficient score of c (`search.score_test`)
- v: Fisher information of c
- κ: variance inflation of the fit's scores (`Estimate.inflation`), near 1 for a valid likelihood

Let φ_1 be the φ with the largest S. It is proposed unless a simpler φ is nearly as good. Several φ
may have an S within κ · `constants.TIE` of the largest. φ_2 is the one of them with the fewest
factors. If φ_2 differs from φ_1, the model is refitted twice, once with each of them, because S is
only an approximation of the increase of 2 ln L. φ_2 is proposed unless its 2 ln L is lower by more
than κ · `TIE`. The other φ within κ · `TIE` are reported as alternatives.

**Curve.** The formula is compared with a curve: a piecewise linear torque of one variable
(`unmodelled.residual_torque`). The same score test of the curve's coefficients has the statistic
S_curve. r is the rank of the information matrix of these coefficients. The curve has r − 1 more
parameters than the formula. The formula is proposed if BIC does not justify these parameters
(N filter updates):

    S_curve − S < κ (r − 1) ln N

**Test without simulated flights.** Usually, simulated flights show whether a residual torque is
significant. If flights cannot be simulated, `significant_formula` takes the formula with the
largest S on each axis. Of these it tests the one with the largest u²/σ_u², which is significant if

    u²/σ_u² > 2 q²

- σ_u² is the variance of u, also valid for coloured noise: the long-run variance (Newey and West)
  of the sum of the scores of c in blocks of `greybox.estimate.BLOCK_S` seconds. The effect of the
  torque c φ is subtracted from these scores first. σ_u² is at least κ v.
- q is the two-sided quantile of Student's distribution for the false-alarm probability
  `TORQUE_FALSE_ALARMS`/m. m is the number of formulas on all axes (Bonferroni).
- The factor 2 allows for the unknown bias of u.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.constants import TIE
from heli3dof.diagnosis.search.candidate_fits import bic_penalty, refit_with_term
from heli3dof.diagnosis.unmodelled.residual_torque import UNITS, hat_sensitivities, hats
from heli3dof.diagnosis.unmodelled.torque_evidence import (
    Evidence,
    evidence_without_nulls,
    informative_directions,
)
from heli3dof.diagnosis.unmodelled.unmodelled_torque import (
    TORQUE_FALSE_ALARMS,
    ResidualTorque,
    TorqueLocation,
)
from heli3dof.distributions import t_isf
from heli3dof.identification.bias_correction.coloured_noise import MEMORY_S, freedom, long_run
from heli3dof.identification.bias_correction.correction import CorrectedFit
from heli3dof.identification.bias_correction.perturbation import forward, project_out
from heli3dof.identification.greybox.estimate import BLOCK_S, block_numbers
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.identification.greybox.maximum_likelihood import Optimum
from heli3dof.model.effects import term
from heli3dof.model.effects.empirical import PREFIX, factors

SINGLE = (
    "sin(roll)", "sin(pitch)", "sin(yaw)", "roll_rate", "pitch_rate", "yaw_rate", "voltage_sum",
    "voltage_difference",
)  # fmt: skip
PRODUCTS = (
    *SINGLE,
    *(f"abs({x})*{x}" for axis in AXES for x in (axis, f"{axis}_rate")),
    *(f"sin({axis})*cos({axis})" for axis in AXES),
    *("*".join(pair) for pair in itertools.combinations_with_replacement(SINGLE, 2)),
    "voltage_front*voltage_back",
)
AT_ONCE = 8
"""Number of products whose sensitivities are in memory at the same time: 8 bytes per product and
encoder reading"""


@dataclass(frozen=True)
class Proposal:
    """A term for an unmodelled torque, with the values at which its fit starts."""

    term: str
    """Name of an empirical effect (`model.effects.empirical`) on an axis"""
    start: tuple[float, ...]
    """Start values of its parameters, in their units"""
    product: str
    """The formula's product, or the variable of the curve"""
    is_formula: bool
    alternatives: tuple[str, ...] = ()
    """Other products that explain almost as much: their S is within `TIE` κ of the largest"""


def proposals(fit: CorrectedFit, torque: ResidualTorque) -> list[Proposal]:
    """Return model terms for ``torque``, best first: at most one formula and one fitted curve.

    The formula is in the list if BIC does not justify the curve's further parameters. The curve is
    in the list if its variable is a product of at most two of
    `heli3dof.model.effects.empirical.QUANTITIES`.
    """
    x = evidence_without_nulls(fit)
    axis = AXES.index(torque.axis)
    kappa = max(fit.inflation, 1.0)
    S, c = product_scores(x, axis)
    first, *others = ordered_products(fit, torque.axis, S, c)
    S_curve, rank = curve_statistic(x, axis, torque.depends_on)
    penalty = kappa * bic_penalty(rank - 1, x.flight.at)
    out = []
    if S_curve - S[first] < penalty:
        product = PRODUCTS[first]
        alternatives = tuple(PRODUCTS[k] for k in others)
        name = f"{PREFIX}{product}.{torque.axis}"
        out.append(Proposal(name, (float(c[first]),), product, True, alternatives))
    if factors(torque.depends_on):
        knots, values = np.array(torque.table).T
        name = f"{PREFIX}spline({torque.depends_on}:{knots[0]:.6g}:{knots[-1]:.6g}).{torque.axis}"
        out.append(Proposal(name, tuple(map(float, values)), torque.depends_on, False))
    return out


def ordered_products(fit: CorrectedFit, axis: str, S: np.ndarray, c: np.ndarray) -> list[int]:
    """Return which products of measured quantities explain the torque on ``axis`` equally well.

    The result contains indices of `PRODUCTS`. The first one is the product that the diagnosis
    proposes as the formula; the others are reported as alternatives (rule: see the module). ``S``
    (P,), ``c`` (P,): test statistics and coefficients from `product_scores` for this axis.
    """
    margin = TIE * max(fit.inflation, 1.0)
    best, *others = (int(k) for k in np.argsort(-S) if S.max() - S[k] < margin)
    simplest = min((best, *others), key=lambda k: len(factors(PRODUCTS[k])))
    if simplest == best:
        return [best, *others]
    others.remove(simplest)
    ln, ln_best = (
        with_product(fit, axis, PRODUCTS[k], float(c[k]))[1].loglik for k in (simplest, best)
    )
    return [best, *others] if 2 * (ln_best - ln) > margin else [simplest, best, *others]


def with_product(
    fit: CorrectedFit, axis: str, product: str, c: float
) -> tuple[Likelihood, Optimum]:
    """Add a torque c φ to the model of ``fit``, and refit all parameters.

    The result is the likelihood function of the extended model, and the maximum that the refit
    found. ``product``: φ as text; ``c``: the coefficient at which the refit starts, in SI units.
    """
    return refit_with_term(fit, term(f"{PREFIX}{product}.{axis}"), (c,))


def significant_formula(x: Evidence) -> TorqueLocation | None:
    """Return axis and variable of the best torque formula; None if it is not significant."""
    fit, flight, nuisance, at = x.fit, x.flight, x.nuisance, x.flight.at
    block = block_numbers(flight.data, BLOCK_S)[at.row]
    blocks, memory = int(block.max()) + 1, round(MEMORY_S / BLOCK_S)
    if blocks < 2 * (memory + 1):
        return None
    best, location = 0.0, TorqueLocation("", "")
    axes = np.flatnonzero(fit.problem.data.axes)
    for i in axes:
        S, c = product_scores(x, int(i))
        k = int(S.argmax())
        (D,) = product_sensitivities(x, int(i), PRODUCTS[k : k + 1])
        d = project_out(D, nuisance.tangents, nuisance.A, at.w)
        s = np.bincount(block, d * (at.g - c[k] * at.w * d), blocks)
        v = float((d * at.w) @ d)
        variance = max(float(long_run(s[:, None], memory)[0, 0]), v * max(fit.inflation, 1.0))
        t2 = (c[k] * v) ** 2 / variance if variance > 0 else 0.0
        if t2 > best:
            best, location = t2, TorqueLocation(AXES[i], variable_of(PRODUCTS[k]))
    p = TORQUE_FALSE_ALARMS / (2 * len(axes) * len(PRODUCTS))
    threshold = 2 * float(t_isf(p, freedom(blocks, memory))) ** 2
    return location if best > threshold else None


def variable_of(product: str) -> str:
    """Return the variable on which a torque proportional to ``product`` is reported to depend.

    The result is a key of `residual_torque.UNITS`. These keys have no sine, cosine or absolute
    value, so these functions are removed from the product. If the remaining product is a key, it is
    the result; otherwise the result is its first factor. The product of both voltages has the key
    ``voltage_product``.

    >>> variable_of("voltage_front*voltage_back"), variable_of("abs(yaw_rate)*yaw_rate")
    ('voltage_product', 'yaw_rate')
    """
    if product == "voltage_front*voltage_back":
        return "voltage_product"
    plain = [name.rstrip(")").rpartition("(")[2] for name in product.split("*")]
    return "*".join(plain) if "*".join(plain) in UNITS else plain[0]


def product_scores(x: Evidence, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the test statistic S (P,) and the estimate c (P,) of a torque c φ on ``axis``.

    P is the number of candidates φ, the products of measured quantities in `PRODUCTS`. S is 0 if
    the flights contain no information about c, or if the fit contains this torque.
    """
    u, v = np.zeros(len(PRODUCTS)), np.zeros(len(PRODUCTS))
    for k in range(0, len(PRODUCTS), AT_ONCE):
        D = product_sensitivities(x, axis, PRODUCTS[k : k + AT_ONCE])
        u[k : k + AT_ONCE], V = projected(x, D)
        v[k : k + AT_ONCE] = np.diag(V)
    fitted = {t.name for t in x.fit.structure.terms}
    known = v > 1e-300
    known &= [f"{PREFIX}{product}.{AXES[axis]}" not in fitted for product in PRODUCTS]
    return np.where(known, u**2 / np.where(known, v, 1.0), 0.0), u / np.where(known, v, np.inf)


def product_sensitivities(x: Evidence, axis: int, products: Sequence[str]) -> np.ndarray:
    """Return derivatives (P, E) of E predicted readings with respect to P torque coefficients.

    Each torque c φ has the coefficient c, in SI units, and acts on the axis with the index
    ``axis``. ``products``: the P products φ as text, such as ``roll_rate*sin(pitch)``.
    """
    p, flight = x.path, x.flight
    middle = (p.chunk[:, 0] + p.chunk[:, 1]) // 2
    phi = np.array([np.nan_to_num(flight.variable(name))[middle] for name in products])
    return forward(p, phi[:, :, None] * flight.B[middle][None, :, :, axis])


def projected(x: Evidence, D: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the score (K,) and the Fisher information (K, K) of the K coefficients of a torque.

    ``D`` (K, E): derivatives of the E predicted encoder readings with respect to the coefficients.
    The fit's parameters are projected out of the score and the information.
    """
    at, nuisance = x.flight.at, x.nuisance
    weighted = D * at.w
    cross = weighted @ nuisance.tangents.T
    solved = np.linalg.solve(nuisance.A, cross.T)
    return D @ at.g - solved.T @ (nuisance.g - x.fit.score_bias), weighted @ D.T - cross @ solved


def curve_statistic(x: Evidence, axis: int, variable: str) -> tuple[float, int]:
    """Return (S, r): score-test statistic and rank of a piecewise linear torque of ``variable``.

    r is the rank of the information matrix of the torque's coefficients. S is 0 if the flight has
    no information on the torque. S is also 0 if the variable changes too little in the flight. The
    table `MIN_RANGE` gives the least range of a variable for each unit.
    """
    flight = x.flight
    library = hats(flight, np.array([axis]))
    if variable not in library.variables:
        return 0.0, 1
    D = hat_sensitivities(library, flight, library.variables.index(variable))
    u, v = projected(x, D)
    E = informative_directions(v, (D * flight.at.w) @ D.T)
    if not E.shape[1]:
        return 0.0, 1
    return float(u @ E @ np.linalg.solve(E.T @ v @ E, E.T @ u)), E.shape[1]
