"""Compute a model's prediction errors by axis and horizon, their noise floor and worst intervals.

**Noise floor.** The noise floor is the RMS prediction error that the true model would have
(`noise_floor_deg`). It should be computed for the model with the effects found: a fit without these
effects attributes them to noise.

**Worst interval.** The worst interval of an axis is the time interval of `WORST_S` in which
predictions over `HORIZON_S` have the largest mean square error.

**Coloured noise.** The filter assumes white process noise: a random angular acceleration n(t) of
each axis, with the spectral density a² (a in rad/s²/√Hz). Draughts and other real torques are
correlated over tenths of a second. The fitted a² then matches the spectrum of n only at high
frequencies, so long predictions are worse than the filter expects. In a prediction over the horizon
h (s), n causes the error e(h). Its variance is ρ(h) times the variance a² h³/3 of white noise:

    e(h) = ∫_0^h (h − s) n(s) ds,       Var e(h) = ρ(h) a² h³/3
    ρ(h) = 1 + 2 Σ_{l ≥ 1} w(l Δ/h) (r_l − r⁰_l),   w(x) = 1 − 3x/2 + x³/2  for x < 1, else 0

w is the normalised autocorrelation of the ramp h − s. r_l − r⁰_l estimates the autocorrelation of n
at the time lag l Δ. For this, time is divided into blocks of Δ = `NOISE_BLOCK_S`. A constant
additional acceleration α of an axis would change the log-likelihood ln L of a flight. u_b is the
contribution of block b to the derivative ∂ ln L/∂α, minus the mean contribution
(`acceleration_scores`).

- r_l: autocorrelation of the u_b at the lag of l blocks, in the m blocks of the recordings
- r⁰_l: the same autocorrelation in the m⁰ blocks of flights simulated with white noise. Encoder
  quantisation causes it. If no flights are simulated, r⁰_l and 1/m⁰ are set to 0

If n is white, the computed ρ has the standard deviation √(4 Σ w² (1/m + 1/m⁰)). ρ is set to 1
unless it exceeds 1 by `QUANTILE_99` standard deviations.

The formula neglects stiffness and damping within the time h. It also assumes that the u_b are
correlated like n, because the filter responds to n in less than the time h. A slow torque that the
model lacks also counts as noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.unmodelled.residual_torque import linearised_run_at
from heli3dof.diagnosis.validation.gain import HORIZON_S
from heli3dof.diagnosis.validation.prediction import (
    HORIZONS_S,
    mean_square,
    model_errors,
    problem_of,
    rows_ahead,
    rows_of_recordings,
    starts_of,
    with_own_values,
)
from heli3dof.errors import RecordingError
from heli3dof.identification.bias_correction.coloured_noise import CHANCE
from heli3dof.identification.bias_correction.perturbation import forward, path
from heli3dof.identification.bias_correction.simulated_flight import simulated_flight
from heli3dof.identification.greybox.estimate import block_numbers
from heli3dof.model.control.voltage_replay import controller_is_known
from heli3dof.model.estimation.ekf_quantised import RATE_0
from heli3dof.model.estimation.filter_data import Data
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.model.greybox.prediction import noise_of
from heli3dof.parallel import parallel_map
from heli3dof.recording.recording import Recording

WORST_S = 3.0
"""s, length of the worst interval. Chosen."""
NOISE_BLOCK_S = 0.05
"""s; a tenth of the time over which torques of real rigs are correlated. Chosen."""
QUANTILE_99 = NormalDist().inv_cdf(1 - CHANCE)
"""99 % quantile of the normal distribution"""


@dataclass(frozen=True)
class WorstInterval:
    """The interval of a recording in which the predictions of one axis have the largest error.

    Times are in s from the recording's first sample.
    """

    axis: str
    recording: str
    start_s: float
    stop_s: float
    rmse_deg: float


@dataclass(frozen=True, eq=False)
class SimulationError:
    """A model's prediction errors over H horizons, by axis, with their noise floor."""

    horizons_s: tuple[float, ...]
    rmse_deg: np.ndarray
    """(H, 3); NaN for an axis that was not measured"""
    floor_deg: np.ndarray
    """(H, 3)"""
    floor_by: str
    """Method that computed the noise floor; empty if the floor is unknown"""
    worst: tuple[WorstInterval, ...]
    """One per measured axis"""

    def at(self, horizon_s: float, axis: str) -> tuple[float, float]:
        """Return (RMSE, noise floor) of an axis in degrees at one of ``horizons_s``."""
        h, i = self.horizons_s.index(horizon_s), AXES.index(axis)
        return float(self.rmse_deg[h, i]), float(self.floor_deg[h, i])


def simulation_error(
    model: GreyBoxModel,
    recordings: Sequence[Recording],
    *,
    truth: GreyBoxModel | None = None,
    seed: int = 0,
) -> SimulationError:
    """Return a model's prediction errors on recordings, and their noise floor.

    The noise floor is the error that would remain if ``truth`` (default: ``model``) were the true
    model. Raises RecordingError if no sample of the recordings is usable.
    """
    data, e = model_errors(model, recordings)
    floor, by = noise_floor_deg(truth or model, recordings, seed=seed)
    rmse = np.degrees(np.sqrt(mean_square(e)))
    at_horizon = e[:, HORIZONS_S.index(HORIZON_S)]
    return SimulationError(HORIZONS_S, rmse, floor, by, _worst(data, at_horizon, recordings))


def _worst(
    data: Data, errors: np.ndarray, recordings: Sequence[Recording]
) -> tuple[WorstInterval, ...]:
    """Return for each axis the time interval of `WORST_S` with the largest prediction error.

    ``errors`` (S, 3): errors in rad of S predictions over `HORIZON_S`. The predictions start at the
    S rows of ``data`` that `starts_of` returns.
    """
    starts, each = starts_of(data), list[WorstInterval]()
    for run, (_, start, stop) in zip(data.runs, data.blocks, strict=True):
        inside = (starts >= start) & (starts < stop)
        t = data.t[starts[inside]] + HORIZON_S  # where the prediction is compared
        if not inside.any():
            continue
        name, last = recordings[run.source].name, float(data.t[stop - 1])
        for start_s in np.arange(t[0], max(last - WORST_S, t[0]) + 1e-9, WORST_S / 3).tolist():
            window = (t >= start_s) & (t < start_s + WORST_S)
            rmse = np.degrees(np.sqrt(mean_square(errors[inside][window])))
            stop_s = min(start_s + WORST_S, last)
            each += [
                WorstInterval(a, name, start_s, stop_s, float(e))
                for a, e in zip(AXES, rmse, strict=True)
                if np.isfinite(e)
            ]
    by_axis = ([w for w in each if w.axis == a] for a in AXES)
    return tuple(max(of_axis, key=lambda w: w.rmse_deg) for of_axis in by_axis if of_axis)


def noise_floor_deg(
    model: GreyBoxModel, recordings: Sequence[Recording], *, flights: int = 2, seed: int = 0
) -> tuple[np.ndarray, str]:
    """Return the noise floor (H, 3) in degrees at `HORIZONS_S`, and the name of the method.

    The noise floor is the RMS error of predictions over H horizons if ``model`` is the true model.
    Its square is the sum of two variances. `coloured_variance` gives the variance due to coloured
    noise. The variance due to white noise is the mean square prediction error in flights that the
    model itself simulates, ``flights`` of them for each recording. In two cases, the filter's
    covariance gives the variance due to white noise instead:

    - The controller is unknown.
    - A simulated flight has no usable rows, as with an unstable model.
    """

    def simulated(replication: int) -> tuple[np.ndarray, list[np.ndarray]]:
        rng = np.random.default_rng([seed, 77, replication])
        flown = [simulated_flight(model, r, rng) for r in recordings]
        scores = [acceleration_scores(model, r) for r in flown]
        return mean_square(model_errors(model, flown)[1]), scores

    white, by = None, "the filter's covariance"
    nulls = list[np.ndarray]()
    if controller_is_known(recordings):
        with suppress(RecordingError):
            results = parallel_map(simulated, flights)
            white = np.mean([square for square, _ in results], axis=0)
            nulls = [u for _, scores in results for u in scores]
            by = f"{flights} flights of the model's own"
    if white is None:
        white = np.radians(covariance_floor_deg(model, recordings)) ** 2
    coloured = coloured_variance(model, recordings, HORIZONS_S, nulls)
    return np.degrees(np.sqrt(white + coloured)), by


def covariance_floor_deg(model: GreyBoxModel, recordings: Sequence[Recording]) -> np.ndarray:
    """Return the noise floor (H, 3) in degrees due to white noise, from the filter's variances.

    H is the number of `HORIZONS_S`. The noise floor is √(P + d²/12). P is the variance of the angle
    that the Kalman filter predicts at the horizon, and d is the encoder step.
    """
    from heli3dof.diagnosis.validation.prediction_passes import prediction_variances

    problem = problem_of(model.structure, recordings)
    noise = noise_of(model)
    flight = linearised_run_at(problem, problem.structure.scaled(model.values), noise)
    d, at = flight.data, flight.at
    starts, rows = starts_of(d), rows_ahead(d, HORIZONS_S)
    out = np.full((len(starts), len(rows), 3), np.nan)
    P0 = np.zeros((len(d.blocks), 6))
    P0[:, :3] = np.where(d.grid > 0, d.grid**2 / 12, problem.encoder_noise)
    P0[:, 3:] = RATE_0**2
    P0 *= np.hstack([d.free, d.free])
    prediction_variances(
        d.blocks, d.free, d.t, d.h, flight.A, flight.slope, at.row, at.state, at.w, at.K,
        noise[:3] ** 2, P0, starts, rows, out,
    )  # fmt: skip
    rounding = np.where(d.axes, (d.grid**2).max(axis=0) / 12, np.nan)
    return np.asarray(np.degrees(np.sqrt(mean_square(np.sqrt(out)) + rounding)))


def coloured_variance(
    model: GreyBoxModel,
    recordings: Sequence[Recording],
    horizons_s: Sequence[float],
    nulls: Sequence[np.ndarray],
) -> np.ndarray:
    """Return the variance (H, 3) rad² that coloured noise adds to predictions over H horizons.

    For an axis and a horizon h (s), it is (ρ − 1) a² h³/3. a (rad/s²/√Hz) is the process noise, ρ
    the variance of the prediction error relative to white noise (`_rho`). ``nulls``: the
    `acceleration_scores` of flights simulated with white noise.
    """
    scores = [acceleration_scores(model, r) for r in recordings]
    h = np.array(horizons_s)
    rho = [
        [_rho([u[:, i] for u in scores], [u[:, i] for u in nulls], float(x)) for i in range(3)]
        for x in h
    ]
    white = noise_of(model)[:3] ** 2 * h[:, None] ** 3 / 3
    return np.asarray((np.array(rho) - 1) * white)


def acceleration_scores(model: GreyBoxModel, recording: Recording) -> np.ndarray:
    """Return the contributions u (m, 3) of m time blocks to the derivatives ∂ ln L/∂α.

    L is the likelihood, and α (rad/s²) a constant additional acceleration of one of the three axes.
    A block lasts `NOISE_BLOCK_S`. For block b and one axis,

        u_b = Σ (∂ ln L/∂c) δc        (sum over the encoder readings in the block)

    c is a predicted reading, and δc the change of c by α = 1 rad/s². The mean over the blocks,
    which a constant torque causes, is subtracted.
    """
    problem, noise = problem_of(model.structure, [recording]), noise_of(model)
    (rows,) = rows_of_recordings(problem.data)
    theta = with_own_values(problem, problem.structure.scaled(model.values), noise, rows)
    at = problem.run(theta, noise, keep=2)
    p = path(problem.structure, problem.values(theta), problem.data, at)
    unit = np.zeros((3, len(p.chunk), 3))
    unit[range(3), :, range(3)] = 1.0
    block = block_numbers(problem.data, NOISE_BLOCK_S)[at.row]
    u = np.column_stack([np.bincount(block, d * at.g) for d in forward(p, unit)])
    return np.asarray(u - u.mean(axis=0))


def _rho(series: Sequence[np.ndarray], nulls: Sequence[np.ndarray], horizon_s: float) -> float:
    """Return ρ: the variance of a prediction error, relative to that with white process noise.

    The prediction is of one axis over ``horizon_s``. ρ is computed from autocorrelations (equation:
    see the module), and is 1 unless it is significantly larger. ``series`` contains one array (m,)
    for each recording: this axis' column of the result of `acceleration_scores`. ``nulls`` contains
    the same arrays for flights simulated with white noise. Encoder quantisation correlates their
    values, too. So the function subtracts their autocorrelations from those of ``series``.

    >>> rng = np.random.default_rng(0)
    >>> white = rng.standard_normal(40_000)
    >>> _rho([white], [], 1.0)
    1.0
    >>> slow = np.convolve(white, np.ones(10))  # autocorrelation at lag l: 1 − l/10
    >>> x = np.arange(1, 10) / 20
    >>> exact = 1 + 2 * ((1 - 1.5 * x + x**3 / 2) * (1 - 2 * x)).sum()
    >>> bool(abs(_rho([slow], [white], 1.0) / exact - 1) < 0.05)
    True
    >>> _rho([slow], [np.convolve(rng.standard_normal(40_000), np.ones(10))], 1.0)
    1.0
    """
    lags = range(1, max(2, round(horizon_s / NOISE_BLOCK_S)))
    x = np.array(lags) * NOISE_BLOCK_S / horizon_s
    w = np.where(x < 1, 1 - 1.5 * x + x**3 / 2, 0.0)

    def correlated(series: Sequence[np.ndarray]) -> float:
        power = sum(float(u @ u) for u in series)
        covariance = [sum(float(u[:-lag] @ u[lag:]) for u in series) for lag in lags]
        return 2 * float(w @ covariance) / power if power > 0 else 0.0

    inverse_m = sum(1 / sum(map(len, s)) for s in (series, nulls) if s)
    rho = 1 + correlated(series) - correlated(nulls)
    std = np.sqrt(4 * float(w @ w) * inverse_m)
    return rho if rho > 1 + QUANTILE_99 * std else 1.0
