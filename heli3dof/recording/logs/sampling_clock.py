"""Estimate a log's sampling clock: period, lost samples, and the true sampling times.

The control loop takes a sample every T s. The log's time stamps are t_k = t_0 + n_k T + ε_k, where
n_k counts all samples, including lost ones. ε_k is an error of the time stamp or of the sampling
time. A phase-locked loop follows the clock,

    n_k = n_{k−1} + round((t_k − ĝ_{k−1}) / T̂),    e_k = t_k − ĝ_{k−1} − (n_k − n_{k−1}) T̂
    ĝ_k = t_k − e_k + α e_k,    T̂ ← T̂ + β e_k

T̂ is the estimated period, ĝ_k the time of sample k on the estimated, evenly spaced clock, and e_k
the time stamp's deviation from the prediction; α and β are small. The count n_k is right while |ε|
stays below half a period. The phase-locked loop also follows a clock that drifts. T̂ and ĝ start at
the values that fit the first time stamps best.

The phase-locked loop is not needed if every interval differs from a multiple of T̂ by less than
T̂/4. Rounding then gives the number of periods in each interval. ε is the residual of a linear
regression of t_k on n_k, separately in each group of `STRETCH` samples.

A large ε has one of two causes:

* The samples were taken at the times of the time stamps.
* The samples were taken evenly, but the time stamps are late. A host that receives several samples
  at once gives all of them nearly the same time stamp: the time stamps come in bursts.

If the time stamps come in bursts, `sampling_times` assumes the second cause. Otherwise it estimates
the jitter σ_t from the motion (`sampling_jitter`), for the time stamps and for evenly spaced times.
It returns the times with the smaller jitter.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from heli3dof.recording.logs.sampling_jitter import motion_jitter
from heli3dof.recording.recording import Recording

ALPHA, BETA = 0.05, 0.0006
SLOW_ALPHA, SLOW_BETA = 0.02, 0.0001
PASSES = 2
STRETCH = 250
HEAD = 500
BUNCHED = 0.1
"""Time stamps are in bursts if more than 10 % of the intervals are shorter than 10 % of the mean
interval. No control loop samples in bursts, and no phase-locked loop locks to bursts."""
CLEAR = 0.25
"""Share of the period: an interval this close to a multiple of the period determines the number of
samples in it. It is half of the rounding limit, 0.5; the other half allows for a wrong period."""
LATE = 0.2
"""Share of the period: time stamps with a smaller jitter are used unchanged"""


@dataclass(frozen=True, eq=False)
class SamplingClock:
    """Sampling period, jitter and sample indices of a log, estimated from its time stamps.

    A lost sample leaves a gap in the indices.
    """

    number: np.ndarray
    """(N,) index n_k of each sample, from 0; the indices of lost samples are left out"""
    period_s: float
    jitter_s: float
    """s, standard deviation of ε, the time stamps' deviation from an evenly spaced clock"""
    jitter_std_s: float
    """s, standard error of ``jitter_s``"""

    @property
    def missing(self) -> np.ndarray:
        """Return (N − 1,): the number of samples lost between each sample and the next.

        The estimate of the sample numbers rounds each time stamp to a sampling period. If a time
        stamp is more than half a period late, its sample gets a number that is too large by one,
        and the right number remains unused. This number does not count as a lost sample.
        """
        k = np.arange(len(self.number))
        lost_until = np.minimum.accumulate((self.number - k)[::-1])[::-1]
        return np.diff(np.maximum(lost_until, 0))

    @property
    def lost(self) -> int:
        """Return the number of lost samples."""
        return int(self.number[-1]) + 1 - len(self.number)


def estimate_clock(t: np.ndarray) -> SamplingClock:
    """Estimate period, sample numbers and jitter from increasing time stamps t (N,) s, N ≥ 2."""
    number = np.arange(len(t)) if in_bursts(t) else _sample_numbers(t)
    jitter, freedom = _scatter(number, t)
    return SamplingClock(
        number, _slope(number, t), jitter, float(jitter / np.sqrt(2 * max(freedom, 1)))
    )


def _sample_numbers(t: np.ndarray) -> np.ndarray:
    """Return each sample's number (N,), from 0; lost samples are counted, too.

    ``t`` (N,): time stamps in s. They must not come in bursts (`in_bursts`).
    """
    period = _period(t)
    intervals = np.diff(t) / period
    steps = np.rint(intervals)
    if (np.abs(intervals - steps) < CLEAR).all():
        return np.concatenate([[0], np.cumsum(steps)]).astype(np.int64)
    # The first count gives an accurate period, with which a slower loop counts again.
    number = _follow(t, period, ALPHA, BETA)
    for _ in range(PASSES):
        if number[-1] == len(t) - 1 and (np.diff(number) == 1).all():
            break
        number = _follow(t, _slope(number, t), SLOW_ALPHA, SLOW_BETA)
    return number


def sampling_times(recording: Recording) -> Recording:
    """Return the recording with the times at which its samples were taken.

    These are the time stamps, or evenly spaced times if all of these conditions hold:

    * The recording has at least `HEAD` samples, and none is lost.
    * The time stamps have a jitter above `LATE` periods.
    * The time stamps are in bursts (`in_bursts`), or fit the motion no better than evenly spaced
      times.
    """
    r = recording
    if len(r) < HEAD or not (np.diff(r.t) > 0).all():
        return r
    clock = estimate_clock(r.t)
    if not clock.jitter_s > LATE * clock.period_s or clock.lost:
        return r
    even = r.t[0] + clock.period_s * clock.number
    if not in_bursts(r.t):
        steps = r.profile.encoder.rad_per_count
        stamped, spaced = (motion_jitter(t, r.angle, steps).sigma_s for t in (r.t, even))
        if stamped < spaced:
            return r
    return replace(r, t=even)


def in_bursts(t: np.ndarray) -> bool:
    """Return True if the time stamps t (N,) come in bursts: many intervals are far below the mean.

    The constant `BUNCHED` states the limits.
    """
    intervals = np.diff(t)
    return bool((intervals < BUNCHED * intervals.mean()).mean() > BUNCHED)


def _follow(t: np.ndarray, period: float, alpha: float, beta: float) -> np.ndarray:
    """Return each sample's number (N,), estimated by a phase-locked loop; lost samples count, too.

    ``t`` (N,): time stamps in s; ``period``: initial estimate of the sampling period in s;
    ``alpha``, ``beta``: gains of the phase and of the period.
    """
    # The first stamp may be late itself: the phase is the circular mean of the first ones.
    turn = np.exp(2j * np.pi * (t[:HEAD] - t[0]) / period)
    grid = float(t[0] + np.angle(turn.sum()) / (2 * np.pi) * period)
    number = np.zeros(len(t), dtype=np.int64)
    n = 0
    for k, now in enumerate(t.tolist()[1:], start=1):
        step = round((now - grid) / period)
        e = now - grid - step * period
        n += step
        number[k] = n
        grid = now - (1 - alpha) * e
        period += beta * e
    return number


def _period(t: np.ndarray) -> float:
    """Return an initial period T in s: the median interval if all intervals are within 10 % of it.

    Otherwise T is the value near the median that maximises |Σ exp(2πi t_k / T)|. The sum is over
    the first `HEAD` time stamps t_k.
    """
    dt = np.diff(t)
    T = float(np.median(dt))
    if (np.abs(dt - T) < 0.1 * T).all():
        return T
    near = T * (1 + np.linspace(-0.03, 0.03, 601))
    turns = np.exp(2j * np.pi * (t[:HEAD, None] - t[0]) / near)
    return float(near[np.argmax(np.abs(turns.sum(axis=0)))])


def _slope(number: np.ndarray, t: np.ndarray) -> float:
    """Return the period in s: the least-squares slope of the times ``t`` (s) over ``number``."""
    n = number - number.mean()
    below = float(n @ n)
    return float(n @ (t - t.mean())) / below if below > 0 else float(np.median(np.diff(t)))


def _scatter(number: np.ndarray, t: np.ndarray) -> tuple[float, int]:
    """Return the jitter's standard deviation (s) and this estimate's degrees of freedom."""
    size = min(STRETCH, len(t))
    whole = len(t) // size * size
    n, x = number[:whole].reshape(-1, size), t[:whole].reshape(-1, size)
    n = n - n.mean(axis=1, keepdims=True)
    x = x - x.mean(axis=1, keepdims=True)
    below = np.maximum((n * n).sum(axis=1), 1.0)
    slope = (n * x).sum(axis=1) / below
    square = float(((x - slope[:, None] * n) ** 2).sum())
    freedom = whole - 2 * len(n)
    return float(np.sqrt(square / max(freedom, 1))), freedom
