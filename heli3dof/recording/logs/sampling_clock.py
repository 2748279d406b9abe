"""Estimate the sampling clock: period, lost samples, and when the samples were really taken.

The loop takes a sample every T s. The log says t_k = t_0 + n_k T + ε_k, where n_k counts the
samples, lost ones too, and ε_k is the error of the stamp or of the sampling. A phase-locked loop
follows the clock,

    n_k = n_{k−1} + round((t_k − ĝ_{k−1}) / T̂),    e_k = t_k − ĝ_{k−1} − (n_k − n_{k−1}) T̂
    ĝ_k = t_k − e_k + α e_k,    T̂ ← T̂ + β e_k

with small α, β, so that the count is right while |ε| stays under half a period, and a clock that
drifts is followed. T̂ and ĝ start where the first stamps fall into step best. ε is the residual
of straight lines t_k over n_k, fitted to stretches of `STRETCH` samples.

If ε is large, either the samples were taken at the stamps, or evenly and only the stamps are late
(a host that receives several samples at once stamps them all then). The motion decides
(`sampling_times`): the jitter σ_t of `sampling_jitter` is computed for both clocks.
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
BUNCHED = 0.5
"""Median over mean of the intervals below which samples were stamped in bursts"""
LATE = 0.2
"""Share of the period: stamps with a smaller jitter are taken as they are"""


@dataclass(frozen=True, eq=False)
class Ticks:
    """The clock of N samples."""

    number: np.ndarray
    """(N,) n_k, from zero"""
    period_s: float
    jitter_s: float
    """Standard deviation of ε"""
    jitter_std_s: float

    @property
    def lost(self) -> int:
        """Samples that should be there and are not."""
        return int(self.number[-1]) + 1 - len(self.number)

    @property
    def longest_gap(self) -> int:
        """Samples lost in a row, at most."""
        return int(np.diff(self.number).max()) - 1


def ticks(t: np.ndarray) -> Ticks:
    """Follow the increasing stamps t (N,) s, N ≥ 10."""
    even = (t[-1] - t[0]) / (len(t) - 1)
    if np.median(np.diff(t)) < BUNCHED * even:  # stamps in bursts: no loop locks to them
        number = np.arange(len(t))
        jitter, freedom = _scatter(number, t)
        return Ticks(number, _slope(number, t), jitter, float(jitter / np.sqrt(2 * freedom)))
    # A count that is nearly right gives the period so well that a slower loop can count again.
    number = _follow(t, _period(t), ALPHA, BETA)
    for _ in range(PASSES):
        if number[-1] == len(t) - 1 and (np.diff(number) == 1).all():
            break
        number = _follow(t, _slope(number, t), SLOW_ALPHA, SLOW_BETA)
    jitter, freedom = _scatter(number, t)
    return Ticks(number, _slope(number, t), jitter, float(jitter / np.sqrt(2 * max(freedom, 1))))


def sampling_times(recording: Recording) -> Recording:
    """Return the recording with the times at which its samples were taken.

    These are its time stamps, or an even clock where the stamps' jitter exceeds `LATE` of the
    period and the motion does not fit them better. Then the stamps are the times of arrival.
    """
    r = recording
    if len(r) < HEAD or not (np.diff(r.t) > 0).all():
        return r
    clock = ticks(r.t)
    if not clock.jitter_s > LATE * clock.period_s or clock.lost:
        return r
    even = r.t[0] + clock.period_s * clock.number
    steps = r.profile.encoder.rad_per_count
    stamped, spaced = (motion_jitter(t, r.angle, steps).sigma_s for t in (r.t, even))
    return r if stamped < spaced else replace(r, t=even)


def _follow(t: np.ndarray, period: float, alpha: float, beta: float) -> np.ndarray:
    """(N,) n_k by the loop of the module, from this period on."""
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
    """A first T: the median interval, or where much is lost or late the T near it at which the
    first stamps fall into step best, max |Σ exp(2πi t_k / T)|."""
    dt = np.diff(t)
    T = float(np.median(dt))
    if (np.abs(dt - T) < 0.1 * T).all():
        return T
    near = T * (1 + np.linspace(-0.03, 0.03, 601))
    turns = np.exp(2j * np.pi * (t[:HEAD, None] - t[0]) / near)
    return float(near[np.argmax(np.abs(turns.sum(axis=0)))])


def _slope(number: np.ndarray, t: np.ndarray) -> float:
    """s per sample, by least squares."""
    n = number - number.mean()
    below = float(n @ n)
    return float(n @ (t - t.mean())) / below if below > 0 else float(np.median(np.diff(t)))


def _scatter(number: np.ndarray, t: np.ndarray) -> tuple[float, int]:
    """Standard deviation of t about straight lines over n, and the degrees of freedom."""
    stretches = max(1, len(t) // STRETCH)
    square, freedom = 0.0, 0
    for n, x in zip(np.array_split(number, stretches), np.array_split(t, stretches), strict=True):
        n_ = n - n.mean()
        x_ = x - x.mean()
        below = float(n_ @ n_)
        slope = float(n_ @ x_) / below if below else 0.0
        square += float(np.sum((x_ - slope * n_) ** 2))
        freedom += len(n) - 2
    return float(np.sqrt(square / max(freedom, 1))), freedom
