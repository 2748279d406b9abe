"""Compute the gain of an extended model on held-out data, with bootstrap intervals.

The gain compares two models on the same rows (`validation.cross_validation`). The model "after" has
additional effects, which the model "before" lacks. The parameters of both models are fitted. So
better values of the same parameters do not count as a gain. The gain consists of ΔRMSE_i, the
decrease of the prediction error of axis i, and Δℓ, the increase of the log-likelihood:

    ΔRMSE_i = RMSE_i(before) − RMSE_i(after)       (°), for predictions over 1 s
    Δℓ = Σ ln Z(after) − Σ ln Z(before)            Z: probability of a reading given earlier ones

A block bootstrap gives the standard deviation s of a gain x. Its blocks are m time intervals of
`CELL_S` seconds (cells), because predictions overlap and noise is correlated within a second. The
95 % interval of x is

    x ± t √(m/(m − 1)) s        t: 97.5 % quantile of Student's t with m − 1 degrees of freedom

It is infinite for a single cell. A gain is significant if the interval of Δℓ lies above zero
(`gain_interval_positive`). RMSE alone may miss a real effect: modelling a periodic torque may lower
it by only 2 %.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.constants import LEVEL
from heli3dof.distributions import t_isf

HORIZON_S = 1.0
"""s, horizon of the predictions. Chosen."""
CELL_S = 2.0
"""s, length of a cell of the bootstrap; longer than the correlation of the noise. Chosen."""
DRAWS = 2000
"""Number of bootstrap samples. Chosen."""


@dataclass(frozen=True)
class Interval:
    """A number with its bootstrap interval, whose confidence is `LEVEL`."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class Predictions:
    """Measured angles at S instants, and predictions of them made `HORIZON_S` earlier."""

    t: np.ndarray
    """(S,) s, on the recording's clock"""
    source: np.ndarray
    """(S,) index of the recording"""
    measured: np.ndarray
    predicted: np.ndarray
    """(S, 3) rad, each"""


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Log-likelihood and squared prediction errors of a model on held-out rows of recordings.

    The recordings are divided into m cells (time intervals) of about `CELL_S` seconds. There is one
    sum for each cell.
    """

    loglik: np.ndarray
    """(m,) Σ ln Z of each cell; empty without a likelihood"""
    squares: np.ndarray
    """(m, 3) rad², Σ e² of the predictions `HORIZON_S` ahead that end in the cell"""
    counts: np.ndarray
    """(m, 3) number of these predictions"""
    start_s: np.ndarray
    """(m,) s, on the recording's clock"""
    source: np.ndarray
    """(m,) index of the recording"""
    on: str
    """Description of the evaluated data, such as "holdout" or "blocks left out\""""
    course: Predictions

    @property
    def rmse_deg(self) -> dict[str, float | None]:
        """Return the predictions' RMSE by axis in degrees; None for an axis not measured."""
        rmse = rms_deg(self.squares.sum(axis=0), self.counts.sum(axis=0)).tolist()
        return {a: x if isfinite(x) else None for a, x in zip(AXES, rmse, strict=True)}


@dataclass(frozen=True, eq=False)
class Gain:
    """How much better a model (``after``) predicts held-out data than another (``before``)."""

    on: str
    """The evaluated data, such as "holdout" or "blocks left out\""""
    before: Mapping[str, float | None]
    after: Mapping[str, float | None]
    """RMSE in degrees, 1 s ahead"""
    rmse_deg: Mapping[str, Interval | None]
    """before − after, in degrees: positive is better"""
    log_likelihood: Interval | None
    """Δℓ; None if the likelihood is not reliable (`free_run.diagnose_free_run`)"""

    @property
    def removes_most_error(self) -> bool:
        """Return True if, on at least one axis, ``after`` removes most of the mean square error.

        The decrease from ``before`` must also be significant (`removes_most`).
        """
        return any(
            won is not None and removes_most(self.before[a] or 0.0, self.after[a] or 0.0, won.low)
            for a, won in self.rmse_deg.items()
        )


def gain(before: HeldOut, after: HeldOut, *, seed: int = 0) -> Gain:
    """Return the gain of one model (after) over another (before), from results on the same rows.

    ``seed``: random seed of the bootstrap.
    """
    m = len(before.squares)
    drawn = np.random.default_rng([seed, 5]).integers(0, m, (DRAWS, m))

    def interval_of(value: float, draws: np.ndarray) -> Interval:
        half = np.inf
        if m > 1:
            t = float(t_isf((1 - LEVEL) / 2, m - 1))
            half = t * np.sqrt(m / (m - 1)) * float(np.nanstd(draws))
        return Interval(value, value - half, value + half)

    delta, likelihood = after.loglik - before.loglik, None
    if len(delta):
        likelihood = interval_of(float(delta.sum()), delta[drawn].sum(axis=1))

    def decrease(cells: np.ndarray) -> np.ndarray:
        counts = before.counts[cells].sum(axis=-2)
        b, a = (rms_deg(x.squares[cells].sum(axis=-2), counts) for x in (before, after))
        return np.asarray(b - a)

    value, draws = decrease(np.arange(m)), decrease(drawn)
    decreases = {
        a: interval_of(float(value[i]), draws[:, i]) if before.counts[:, i].any() else None
        for i, a in enumerate(AXES)
    }
    return Gain(before.on, before.rmse_deg, after.rmse_deg, decreases, likelihood)


def interval(draws: np.ndarray) -> tuple[float, float]:
    """Return the central interval that contains the share `LEVEL` of the bootstrap ``draws``.

    NaN are left out.
    """
    tail = 50 * (1 - LEVEL)
    low, high = np.nanpercentile(draws, [tail, 100 - tail])
    return float(low), float(high)


def removes_most(before: float, after: float, low: float) -> bool:
    """Return True if an RMSE decreases significantly, and its square by more than half.

    ``before``, ``after``: the RMSE. ``low``: lower end of the interval of before − after.
    """
    return low > 0 and before**2 > 2 * after**2


def gain_interval_positive(g: Gain) -> bool:
    """Return True if the log-likelihood gain's interval lies above zero.

    Without a reliable likelihood, the result is False.
    """
    return g.log_likelihood is not None and g.log_likelihood.low > 0


def rms_deg(squares: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Return the RMSE in degrees; NaN where ``counts`` is zero.

    ``squares``: sums of squared errors in rad²; ``counts``: number of errors in each sum.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.degrees(np.sqrt(squares / counts)))


def sums_by_cell(errors: np.ndarray, cell: np.ndarray, m: int) -> tuple[np.ndarray, np.ndarray]:
    """Return Σ e² in rad², and the number of errors e, in each of m cells: two arrays (m, 3).

    ``errors`` (S, 3) rad: the errors of S predictions; NaN are not counted. ``cell`` (S,): the
    index of the cell to which each prediction belongs.
    """
    squares, counts = (
        np.column_stack([np.bincount(cell, v, m) for v in of_axes.T])
        for of_axes in (np.nan_to_num(errors) ** 2, np.isfinite(errors))
    )
    return squares, counts
