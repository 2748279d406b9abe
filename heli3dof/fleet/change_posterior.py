"""Probabilities that a quantity changed during a series of flights, by Bayesian model comparison.

n flights give values yᵢ of the quantity with standard deviations sᵢ, at the times tᵢ. Each model of
a change is a regression on a constant level m and a change of size δ with the regressor x::

    yᵢ = m_p(i) + δ·xᵢ + eᵢ,   eᵢ ~ N(0, φ²uᵢ),   uᵢ = (1 − a)(sᵢ/s̃)² + a,   δ ~ N(0, g²φ²)

    step before flight k     xᵢ = 1 for i ≥ k, else 0      2 ≤ k ≤ n − 2, counted from 0
    drift                    xᵢ = (tᵢ − t₀)/(tₙ₋₁ − t₀)     δ: change over all flights
    deviating flight j       xᵢ = 1 for i = j, else 0
    two steps                the sum of two steps, before j and k ≥ j + 2, each with its own δ

- p(i): the plan of flight i. Each plan has its own level m, because the estimate also depends on
  the plan: on the same rig, small and large reference steps give different values
- s̃: the median of the sᵢ
- φ: the standard deviation of the value from a flight with sᵢ = s̃
- a: the fraction of φ² that is due to scatter between flights
- g: the typical size of a change, divided by φ

A step needs two flights on each side, because one flight alone is a deviating flight. Two steps
need a model of their own: if the second one reverses or repeats the first, the model of one step
fits badly. To save time, j and k of two steps can only take values of an evenly spaced grid with at
most `MOST_BOUNDARIES` points.

Priors:

- m: flat
- a: each value of the grid `SHARES` has the same probability. The grid is dense near 0
- g: each value of the grid `SIZES` (1, 2, 4, … 32) has the same probability
- φ²: d·φ₀²/χ²_d. φ₀ is estimated from the other rigs of the fleet (the rig's siblings)
- d: 1 with the probability `UNLIKE`, else a value that is also estimated from the siblings
  (`VariancePrior`). Without siblings, d is 0, which means p(φ) ∝ 1/φ

The integrals over m, δ and φ have a closed form. Let wᵢ = 1/uᵢ, P the number of plans, and
ν = n − P. x′ᵢ and y′ᵢ are xᵢ and yᵢ minus their means over the flights of the same plan, with the
weights wᵢ. With Sxx = Σwᵢx′ᵢ², Sxy = Σwᵢx′ᵢy′ᵢ and Syy = Σwᵢy′ᵢ²::

    p(y | x, a, g, d) ∝ √(Πᵢwᵢ/Π_pΣwᵢ) · (1 + g²Sxx)^(−½) · C_d · (R + dφ₀²)^(−(ν+d)/2)
    R = Syy − Sxy²·B,   B = g²/(1 + g²Sxx),   C_d = Γ((ν+d)/2)/Γ(d/2) · (dφ₀²)^(d/2),   C₀ = 1
    δ | x, a, g, d, y ~ Student t with ν + d degrees of freedom, mean B·Sxy,
                        scale² B·(R + dφ₀²)/(ν + d)

An estimate at the bound of an absent effect (a lag of 0) has lost its scatter: its true deviation
from the level has the variance hᵢ = sᵢ². R then contains Σwᵢhᵢ, the expected sum of the lost
squares. Elsewhere, hᵢ = 0.

A step at a change of plan has Sxx = 0: the flights cannot distinguish the step from the plan.

The model without a change has g = 0. For two steps, Sxx is a matrix and Sxy a vector: 1 + g²Sxx
becomes det(I + g²Sxx), and Sxy²·B becomes Sxyᵀ(Sxx + I/g²)⁻¹Sxy. The probability of each kind of
change is a sum over a, g, d and over the flights at which the change may occur (Kass and Raftery,
J. Am. Stat. Assoc. 90, 1995).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from heli3dof.arrays import FloatArray

SHARES = np.linspace(0.0, 1.0, 9) ** 2
"""Grid of a, the fraction of the variance φ² that is due to scatter between flights. Chosen."""
SIZES: FloatArray = np.exp2(np.arange(6.0))
"""Grid of g, the typical size of a change in standard deviations φ of a flight. Chosen: below 1, a
change cannot be detected; above 32, g has no more influence on the result."""
KINDS = ("step", "two_steps", "drift", "deviating")
SINGLE = ("step", "drift", "deviating")
"""Kinds with one size δ"""
Candidates = Mapping[str, tuple[tuple[int, ...], ...]]
Prior = Mapping[str, float]
"""Kind of change → its prior probability in one series of flights"""
UNLIKE = 0.01
"""Prior probability that a rig's scatter is unlike that of its siblings (d = 1). Chosen below 1/40,
the probability of a step in any quantity of a rig: otherwise, with few flights, a large scatter
would explain every step. Unlike a step's prior, it is not divided by the number of quantities,
because a rig that scatters more does so in all of them."""
LEAST_SIDE = 2
"""Fewest flights on each side of a step: one alone is a deviating flight (a definition)"""
MOST_BOUNDARIES = 30
"""Most grid points for j and k of two steps. Chosen: this limits the pairs (j, k) to about 400. The
search then computes the date of each step without a grid."""


@dataclass(frozen=True)
class VariancePrior:
    """Prior distribution d·φ₀²/χ²_d of φ², the variance of a quantity's value from one flight.

    Each flight of a rig gives a value of the quantity and a standard deviation of this value. φ² is
    the variance for a flight whose standard deviation is the median of the rig's flights. χ²_d is a
    chi-squared variable with d degrees of freedom. d is 1 with the probability `UNLIKE`, for a rig
    that is unlike the other rigs of the fleet (its siblings). Otherwise, d is ``freedom``.
    ``variance`` (φ₀²) and ``freedom`` are estimated from the siblings.
    """

    variance: float
    """φ₀² > 0: typical variance of the siblings, in the squared unit of the value"""
    freedom: float
    """≥ 1; the more alike the siblings' variances are, the larger it is"""


@dataclass(frozen=True, eq=False)
class ChangePosterior:
    """Posterior probabilities and sizes of the changes that are possible in a series of n flights.

    Each candidate change, such as a step before flight 5, is one model of a Bayesian comparison.
    """

    candidates: Candidates
    """{kind of change: its candidates}, as `candidate_changes` returns them"""
    constant: float
    """Posterior probability that nothing changed"""
    probability: Mapping[str, FloatArray]
    """{kind: posterior probability of each candidate}; all of them and ``constant`` sum to 1"""
    size: Mapping[str, FloatArray]
    """{kind: posterior mean of each candidate's size δ}, in the unit of y; not for ``two_steps``"""
    size_std: Mapping[str, FloatArray]
    """{kind: posterior standard deviation of each candidate's size δ}; not for ``two_steps``"""

    def kind(self, name: str) -> float:
        """Return the posterior probability of the kind of change ``name``, one of `KINDS`."""
        return float(self.probability[name].sum())

    @property
    def most_probable(self) -> str:
        """Return the most probable kind of change."""
        return max(KINDS, key=self.kind)

    def best(self, kind: str) -> int:
        """Return the index of the most probable candidate of a kind of change."""
        return int(np.argmax(self.probability[kind]))


def change_posterior(
    y: FloatArray, s: FloatArray, t: FloatArray, prior: Prior,
    plans: np.ndarray | None = None, variance_prior: VariancePrior | None = None,
    hidden: FloatArray | float = 0.0,
) -> ChangePosterior:  # fmt: skip
    """Return the posterior of all changes of a quantity that are possible in n flights of one rig.

    ``y`` (n,): the value that each flight gives; ``s`` (n,): its standard deviation, s > 0. ``t``
    (n,): the flights' times, increasing, in any unit. ``prior``: the prior probability of each kind
    of change. ``plans`` (n,): the flight plan of each flight; None: all have the same plan. n must
    exceed the number of plans by at least 3.

    φ² is the variance of the value from a flight whose ``s`` is the median. It is unknown, so only
    the ratios of the ``s`` matter. ``variance_prior``: the prior of φ²; None: p(φ) ∝ 1/φ.
    ``hidden`` (n,): the variances hᵢ.
    """
    from scipy.special import gammaln, logsumexp

    n = len(y)
    candidates = candidate_changes(n)
    x = {kind: regressors(kind, candidates, t) for kind in SINGLE}
    ratio = (s / np.median(s)) ** 2
    w = 1.0 / ((1 - SHARES)[:, None] * ratio + SHARES[:, None])  # (a, i)
    plan = np.zeros(n, int) if plans is None else np.unique(plans, return_inverse=True)[1]
    of_plan = w[:, None, :] * (plan == np.arange(plan.max() + 1)[:, None])  # (a, plan, i)
    sum_w = of_plan.sum(axis=2)
    r = y - ((of_plan @ y) / sum_w)[:, plan]  # (a, i)
    s_yy = np.einsum("ai,ai->a", w, r**2)
    if not np.all(s_yy > (np.finfo(float).eps * np.abs(y).max()) ** 2 * n):  # equal values
        zeros = {kind: np.zeros(len(candidates[kind])) for kind in KINDS}
        return ChangePosterior(candidates, 1.0, zeros, zeros, zeros)
    s_xy = {kind: (w * r) @ x[kind].T for kind in SINGLE}  # (a, model)
    mean = {k: of_plan @ x[k].T / np.sqrt(sum_w)[:, :, None] for k in SINGLE}  # (a, plan, model)
    s_xx = {k: np.maximum(w @ (x[k] ** 2).T - (mean[k] ** 2).sum(axis=1), 0.0) for k in SINGLE}

    square = np.square(SIZES)[:, None, None]  # (g, a, model) from here on
    occam = {kind: 1 + square * s_xx[kind] for kind in SINGLE}
    shrink = {kind: square / occam[kind] for kind in SINGLE}
    gain = {kind: s_xy[kind] ** 2 * shrink[kind] for kind in SINGLE}
    gain["two_steps"], occam["two_steps"] = _two_steps(
        candidates, w, mean["step"], x["step"], s_xy["step"], s_xx["step"], square
    )
    nu = n - sum_w.shape[1]
    degrees = [0.0] if variance_prior is None else [1.0, variance_prior.freedom]
    freedom = np.array(degrees)[:, None, None, None]  # (d, g, a, model) from here
    known = freedom * (0.0 if variance_prior is None else variance_prior.variance)  # dφ₀²
    normal = 0.0 if variance_prior is None else (
        gammaln((nu + freedom) / 2) - gammaln(freedom / 2) + 0.5 * freedom * np.log(known)
        + np.log([UNLIKE, 1 - UNLIKE])[:, None, None, None]
    )  # fmt: skip
    evidence = 0.5 * (np.log(w).sum(axis=1) - np.log(sum_w).sum(axis=1))[:, None]  # (a, 1)
    known = known + (w @ np.broadcast_to(hidden, n))[:, None]  # (d, 1, a, 1): dφ₀² + Σwᵢhᵢ
    left = {  # R + dφ₀²
        kind: s_yy[:, None] * np.maximum(1 - gain[kind] / s_yy[:, None], 1e-12) + known
        for kind in KINDS
    }
    each = {
        kind: evidence + normal - 0.5 * np.log(occam[kind])
        - 0.5 * (nu + freedom) * np.log(left[kind])
        for kind in KINDS
    }  # fmt: skip
    constant = evidence + normal - 0.5 * (nu + freedom) * np.log(s_yy[:, None] + known)
    log_constant = _log_mean_evidence(constant)[0] + np.log(1 - sum(prior[kind] for kind in KINDS))
    models = {kind: _log_mean_evidence(each[kind]) for kind in KINDS}
    weight = {
        kind: models[kind] + np.log(prior[kind] / max(len(candidates[kind]), 1)) for kind in KINDS
    }
    total = logsumexp(np.concatenate([[log_constant], *weight.values()]))
    size, spread = {}, {}
    for kind in SINGLE:
        share = np.exp(each[kind] - models[kind])
        share /= share.sum(axis=(0, 1, 2))  # of each (d, g, a) in a model
        mean_size = s_xy[kind] * shrink[kind]
        # Variance of Student's t with ν + d degrees of freedom
        variance = shrink[kind] * left[kind] / np.maximum(nu + freedom - 2, 1)
        size[kind] = (share * mean_size).sum(axis=(0, 1, 2))
        spread[kind] = (share * (variance + (mean_size - size[kind]) ** 2)).sum(axis=(0, 1, 2))
    return ChangePosterior(
        candidates,
        float(np.exp(log_constant - total)),
        {kind: np.exp(weight[kind] - total) for kind in KINDS},
        size,
        {kind: np.sqrt(spread[kind]) for kind in SINGLE},
    )


def _log_mean_evidence(log_evidence: FloatArray) -> FloatArray:
    """Return (model,): the logarithm of each model's mean evidence over all grid points.

    The mean is that of the evidence, not of its logarithm. ``log_evidence`` (d, g, a, model): the
    logarithm of each model's evidence at each grid point. d is the number of degrees of freedom of
    the variance's prior, and g is the typical size of a change. a is the fraction of the variance
    that is due to scatter between flights.
    """
    rows = log_evidence.reshape(int(np.prod(log_evidence.shape[:-1])), log_evidence.shape[-1])
    total: FloatArray = np.logaddexp.reduce(rows, axis=0) - np.log(len(rows))
    return total


def _two_steps(
    candidates: Candidates, w: FloatArray, mean: FloatArray, x: FloatArray, s_xy: FloatArray,
    s_xx: FloatArray, square: FloatArray,
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """Return the arrays Sxyᵀ(Sxx + I/g²)⁻¹Sxy and det(I + g²Sxx) for each pair of steps.

    y are the values of the quantity in n flights. The regressor of a step is 1 in all flights after
    the step, and 0 before it. For one pair, the 2×2 matrix Sxx has the weighted products of the two
    steps' regressors, and the vector Sxy has their weighted products with y.

    g is the typical size of a change. a is the fraction of the variance that is due to scatter
    between flights. Both arrays have the shape (g, a, pair): an element for each grid value of g,
    each grid value of a and each pair. ``candidates`` contains the pairs. The other arguments
    describe the n flights and the K single steps:

    - ``w`` (a, n): the weight wᵢ of each flight
    - ``x`` (K, n): the regressor of each single step
    - ``mean`` (a, plan, K): the weighted mean of each regressor over the flights of each plan,
      multiplied by √Σwᵢ of these flights
    - ``s_xy``, ``s_xx`` (a, K): the scalars Sxy and Sxx of each single step
    - ``square`` (g, 1, 1): g²
    """
    pairs = np.array(candidates["two_steps"], dtype=int).reshape(-1, 2) - LEAST_SIDE
    j, k = pairs.T
    # The product of both regressors is that of the later step.
    s_jk = (w @ x.T)[:, k] - np.einsum("apm,apm->am", mean[:, :, j], mean[:, :, k])
    b_j, b_k = s_xy[:, j], s_xy[:, k]
    jj, kk = (s_xx[:, i] + 1 / square for i in (j, k))
    det = jj * kk - s_jk**2
    gain = (kk * b_j**2 - 2 * s_jk * b_j * b_k + jj * b_k**2) / det
    return gain, square**2 * det


def candidate_changes(n: int) -> Candidates:
    """Return {kind of change: the candidate changes of this kind} for a series of ``n`` flights.

    A candidate is a tuple of flight indices. For a step, it contains the first flight after the
    step; for two steps, the first flight after each. A drift is the tuple (0,). For a deviating
    flight, it contains this flight.

    >>> candidate_changes(5)["step"]
    ((2,), (3,))
    """
    firsts = range(LEAST_SIDE, n - LEAST_SIDE + 1)
    grid = firsts[:: -(-len(firsts) // MOST_BOUNDARIES)]
    return {
        "step": tuple((k,) for k in firsts),
        "two_steps": tuple((j, k) for j in grid for k in grid if k - j >= LEAST_SIDE),
        "drift": ((0,),),
        "deviating": tuple((j,) for j in range(n)),
    }


def regressors(kind: str, candidates: Candidates, t: FloatArray) -> FloatArray:
    """Return the regressors x (K, n) of the K candidate changes of one ``kind``, in n flights.

    A candidate of size δ adds δ·x to the flights' values. ``kind`` is "step", "drift" or
    "deviating". ``candidates``: what `candidate_changes` returns. ``t`` (n,): the flights' times.
    """
    flights, at = np.arange(len(t)), np.array(candidates[kind])
    if kind == "drift":
        time = t - t[0] if t[-1] > t[0] else flights.astype(float)
        return np.asarray(time / time[-1])[None, :]
    return np.asarray(flights >= at if kind == "step" else flights == at, dtype=float)
