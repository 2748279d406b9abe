"""What an extension gains on data that neither it nor the base was fitted to.

Both are evaluated on the same rows (`HeldOut`: hold-out recordings, or blocks that were left out,
`validation.cross_validation`), the base always *refitted*: a gain is never mere calibration.

    ΔRMSE_i = RMSE_i(before) − RMSE_i(after),  1 s ahead of re-estimated states
    Δℓ = Σ ln Z(after) − Σ ln Z(before)

Their 95 % intervals come from a bootstrap over cells of `CELL_S`: errors overlap and noise is
correlated within a second, so cells are drawn, not rows. An extension `pays` where the interval
of Δℓ lies above zero; RMSE alone hides real effects (2 % for a periodic torque).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.validation.prediction import floor_deg, model_ahead, noise_of, problem_of
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.recording.recording import Recording

HORIZON_S = 1.0
CELL_S = 2.0
DRAWS = 2000
LEVEL = 0.95


@dataclass(frozen=True)
class Interval:
    """A number with its bootstrap interval at `LEVEL`."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class Course:
    """Predictions `HORIZON_S` ahead at S instants, beside what was measured then."""

    t: np.ndarray
    """(S,) s, on the recording's clock"""
    source: np.ndarray
    """(S,) which recording"""
    measured: np.ndarray
    predicted: np.ndarray
    """(S, 3) rad"""


@dataclass(frozen=True, eq=False)
class HeldOut:
    """A fit on rows that it has not seen: m cells of `CELL_S`."""

    loglik: np.ndarray
    """(m,) Σ ln Z of each cell"""
    squares: np.ndarray
    """(m, 3) rad², Σ e² of the predictions `HORIZON_S` ahead that end in it"""
    counts: np.ndarray
    """(m, 3) how many"""
    start_s: np.ndarray
    """(m,) s, on the recording's clock"""
    source: np.ndarray
    """(m,) which recording"""
    on: str
    """"holdout" or "blocks left out\""""
    course: Course

    @property
    def rmse_deg(self) -> dict[str, float | None]:
        """By axis; None where it was not measured."""
        return _by_axis(_rmse_deg(self.squares.sum(axis=0), self.counts.sum(axis=0)))


@dataclass(frozen=True, eq=False)
class Gain:
    """What ``after`` gains on ``before``."""

    on: str
    before: Mapping[str, float | None]
    after: Mapping[str, float | None]
    """RMSE in degrees, 1 s ahead"""
    rmse_deg: Mapping[str, Interval | None]
    """before − after: positive is better"""
    log_likelihood: Interval | None
    """None where no likelihood can be trusted (`free_run.diagnose_free_run`)"""
    worst: Worst | None
    """Where ``before`` is furthest off"""

    @property
    def of_calibration(self) -> bool:
        """True if, on an axis, the error removed exceeds the error that remains, significantly.

        ``before`` has the profile's numbers, ``after`` refitted ones: e_before² − e_after² >
        e_after², and the interval of e_before − e_after lies above zero.
        """
        return any(
            won is not None and won.low > 0 and before**2 > 2 * after**2
            for won, before, after in (
                (self.rmse_deg[a], self.before[a] or 0.0, self.after[a] or 0.0) for a in AXES
            )
        )


@dataclass(frozen=True)
class Worst:
    """The worst stretch: (s on the recording's clock), its axis, RMSE before and after."""

    source: int
    start_s: float
    stop_s: float
    axis: str
    before_deg: float
    after_deg: float


def gain(before: HeldOut, after: HeldOut, *, seed: int = 0) -> Gain:
    """Both on the same rows. ``seed`` is the bootstrap's."""
    m = len(before.loglik)
    drawn = np.random.default_rng([seed, 5]).integers(0, m, (DRAWS, m))
    delta = after.loglik - before.loglik
    tail = 50 * (1 - LEVEL)
    low, high = np.percentile(delta[drawn].sum(axis=1), [tail, 100 - tail])
    rmse: dict[str, Interval | None] = {}
    for i, axis in enumerate(AXES):
        n = before.counts[:, i]
        if not n.sum():
            rmse[axis] = None
            continue

        def fall(of: np.ndarray, i: int = i, n: np.ndarray = n) -> np.ndarray:
            count = n[of].sum(axis=-1)
            two = [_rmse_deg(h.squares[of, i].sum(axis=-1), count) for h in (before, after)]
            return np.asarray(two[0] - two[1])

        ends = np.nanpercentile(fall(drawn), [tail, 100 - tail])
        rmse[axis] = Interval(float(fall(np.arange(m))), float(ends[0]), float(ends[1]))
    return Gain(
        before.on, before.rmse_deg, after.rmse_deg, rmse,
        Interval(float(delta.sum()), float(low), float(high)), worst(before, after),
    )  # fmt: skip


def pays(g: Gain) -> bool:
    """True where held-out data are surely likelier under the extension."""
    return g.log_likelihood is not None and g.log_likelihood.low > 0


def worst(before: HeldOut, after: HeldOut) -> Worst | None:
    """The cell in which ``before`` is furthest off, each axis in units of its own median cell.

    None where no prediction could be made at all.
    """
    if not after.counts.any():
        return None
    with np.errstate(invalid="ignore", divide="ignore"):
        cells = _rmse_deg(before.squares, before.counts)
        then = _rmse_deg(after.squares, after.counts)
        told = after.counts > 0
        usual = np.array(
            [np.median(x[k]) if k.any() else np.nan for x, k in zip(then.T, told.T, strict=True)]
        )
        ratio = np.where(before.counts > 0, cells / usual, np.nan)
    if not np.isfinite(ratio).any():
        return None
    at, i = np.unravel_index(int(np.nanargmax(ratio)), ratio.shape)
    start = float(before.start_s[at])
    return Worst(
        int(before.source[at]), start, start + CELL_S, AXES[int(i)],
        float(cells[at, i]), float(then[at, i]),
    )  # fmt: skip


def rmse_deg(model: GreyBoxModel, recordings: Sequence[Recording]) -> dict[str, float | None]:
    """Of a model as it stands, 1 s ahead, by axis in degrees; None where it was not measured."""
    return _by_axis(model_ahead(model, recordings, (HORIZON_S,))[1].rmse_deg()[0])


def noise_floor_deg(
    model: GreyBoxModel, recordings: Sequence[Recording], seed: int = 0
) -> dict[str, float | None]:
    """The error that is left where the model is the truth; see `validation.prediction`."""
    return _by_axis(floor_deg(model, recordings, (HORIZON_S,), seed=seed)[0][0])


def log_likelihood(model: GreyBoxModel, recordings: Sequence[Recording]) -> float:
    """Σ ln Z of the recordings under the model as it stands."""
    problem = problem_of(model, recordings)
    theta = problem.coordinates(model.values)
    return float(problem.run(theta, noise_of(model), keep=0).loglik.sum())


def _rmse_deg(squares: np.ndarray, counts: np.ndarray) -> np.ndarray:
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.degrees(np.sqrt(squares / counts)))


def _by_axis(values: np.ndarray) -> dict[str, float | None]:
    return {a: float(v) if np.isfinite(v) else None for a, v in zip(AXES, values, strict=True)}
