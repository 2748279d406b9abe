"""Finds the single wiring fault that explains how the rig moved before a safety trip.

Each hypothesis H is one fault: an encoder counts the wrong way, the leads of the two motors are
swapped, one motor turns the wrong way, or one or both motors give no thrust. From the same voltages
and angles, each hypothesis predicts other accelerations α_H(t)
(`heli3dof.experiment.safety_monitors.axis_observer`). For each axis, over the last 0.4 s before
control was lost (the *window*, `WINDOWS_S`), the search fits to the measured angle

    θ(t) = θ₀ + ω₀ t + ½ b t² + s ∬ α_H dt²        0.4 ≤ s ≤ 2.5

θ₀, ω₀: initial angle and rate; s: scale factor of α_H; b ~ N(0, B²): an unmodelled
acceleration (friction, a wrong hover voltage). v is the mean squared residual plus q²/12, the
variance of quantisation (q: rad per count); n is the number of independent residuals. The score of
a hypothesis is the Gaussian log-likelihood −½ Σ (n ln v + (b/B)²), summed over the axes that moved.
Before it compares the scores, the search rejects faults that contradict the earlier motion. A motor
may lose its thrust at any time, but every other fault lasts the whole flight. So the search divides
the motion before the window into parts of 0.4 s, and scores each part. It rejects a fault that
lasts the whole flight in two cases:

* The sum of its scores over the parts is more than `SURE` below the sum for a rig without fault.
* Roll has read more than 2° above its angle on the table, and the fault makes this impossible. With
  a wrong roll sign, an arm above the table reads below it. With a motor that turns the wrong way,
  the two thrusts cancel, so the arm does not rise.

Of the faults that are not rejected, `wiring_fault` reports the one with the highest score in the
window if three conditions hold:

* Its score exceeds the score of a rig without fault by more than `SURE`.
* Its score exceeds the score of every other fault that is not rejected by more than `DISTINCT`.
* No rejected fault has a score that exceeds its score by `SURE` or more.

If a condition fails, the search repeats the test on longer windows, up to 1.6 s.

The window ends before pitch reached its mechanical stop, and before the arm came down on the table,
because these limit the motion. If an encoder froze in the air, the window ends at the last change
of its count, because the later angles are wrong.

One fault needs no fit: if roll reads more than 2° below its angle on the table while both motors
have positive voltages, the roll encoder counts the wrong way.

The functions have the arguments ``t`` (n,) in s, ``angle`` (n, 3) in rad and ``applied`` (n, 2) in
V: the times, angles and motor voltages of n samples, as measured.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from itertools import pairwise
from math import radians
from typing import NamedTuple

import numpy as np

from heli3dof.axes import AXES, MOTORS
from heli3dof.experiment.safety_monitors.axis_observer import (
    ON_TABLE,
    PITCH_STOP,
    ExpectedAcceleration,
)
from heli3dof.rig.profile import Profile
from heli3dof.rig.trip import Trip

WINDOWS_S = (0.4, 0.8, 1.6)
"""s: lengths of the windows. The shortest shows a late fault, the longest the slow motion if yaw
counts the wrong way. All are multiples of the first"""
SHORTEST = 20
"""Fewest control periods to fit; an axis with fewer is not used"""
MOVED = 6
"""Fewest counts that an axis must have turned by"""
INDEPENDENT_S = 0.02
"""s between independent residuals: ten periods at 500 Hz"""
BELOW_TABLE = radians(2.0)
"""rad: roll further below its rest angle, which the table prevents, shows a wrong encoder sign;
roll further above it shows that the sign and the motors are right"""
UNKNOWN = 0.5
"""B as a share of `ExpectedAcceleration.typical`"""
GAIN = (0.4, 2.5)
"""Range of s: thrust gains of published rigs differ by a factor of two"""
SURE, DISTINCT = 10.0, 4.0
"""Differences of log-likelihood: to no fault (ratio e¹⁰ = 22,000), and between faults (e⁴ = 55)"""


class Moment(NamedTuple):
    """Measured angles and motor voltages of one control period before a safety trip."""

    t: float
    """s"""
    angle: tuple[float, float, float]
    """rad, as measured"""
    applied: tuple[float, float]
    """V, front and back"""


class Fault(NamedTuple):
    """A wiring fault: its description, its fix, and its effect on encoder signs and thrusts."""

    what: str
    fix: str
    sign: tuple[int, int, int] = (1, 1, 1)
    """Factor of each encoder's angle from its rest angle: −1 if the encoder counts the wrong way"""
    mix: tuple[tuple[int, int], tuple[int, int]] = ((1, 0), (0, 1))
    """Rows: effective voltage of the front, the back motor; columns: front, back voltage applied"""
    sudden: bool = False
    """True if the fault may occur in the air; False if it lasts the whole flight"""

    @property
    def keeps_on_table(self) -> bool:
        """Return True if, with this fault, the measured roll angle never exceeds the rest angle.

        This is so if the roll encoder counts the wrong way. It is also so if one motor turns the
        wrong way: the two thrusts then cancel, and the arm stays on the table.
        """
        return self.sign[0] < 0 or min(min(row) for row in self.mix) < 0


NORMAL = Fault("", "")
_SIGN = "change the sign of encoder.{axis} in the profile, then turn it by hand: heli3dof monitor"
FAULTS = (
    *(
        Fault(
            f"the {axis} encoder counts the wrong way",
            _SIGN.format(axis=axis),
            sign=(-1 if i == 0 else 1, -1 if i == 1 else 1, -1 if i == 2 else 1),
        )
        for i, axis in enumerate(AXES)
    ),
    Fault(
        "the leads of the two motors are swapped",
        "swap the two motors' leads at the amplifier",
        mix=((0, 1), (1, 0)),
    ),
    Fault(
        "no motor pulls",
        "check the amplifier's supply, its fuse and the motors' plug, with the amplifier switched "
        "off",
        mix=((0, 0), (0, 0)),
        sudden=True,
    ),
    *(
        Fault(
            f"the {motor} motor {what}",
            fix.format(motor=motor),
            mix=((gain, 0), (0, 1)) if i == 0 else ((1, 0), (0, gain)),
            sudden=gain == 0,
        )
        for what, fix, gain in (
            (
                "does not pull",
                "check its fuse, its leads and its rotor, with the amplifier switched off",
                0,
            ),
            ("turns the wrong way", "swap the two wires of the {motor} motor", -1),
        )
        for i, motor in enumerate(MOTORS)
    ),
)


def wiring_fault(
    moments: Sequence[Moment], profile: Profile, invalid_s: float = 0.0
) -> Fault | None:
    """Return the wiring fault that explains the motion before a trip; None if none clearly does.

    ``moments``: the last control periods before the safety trip. ``invalid_s``: the angles of the
    last ``invalid_s`` seconds are not fitted, because an encoder was frozen.
    """
    if len(moments) < SHORTEST:
        return None
    t = np.array([m.t for m in moments])
    angle = np.array([m.angle for m in moments])
    applied = np.array([m.applied for m in moments])
    if angle[-1, 0] < profile.encoder.rest_rad[0] - BELOW_TABLE and applied[-SHORTEST:].min() > 0:
        return FAULTS[0]
    moved = t <= t[-1] - invalid_s
    t, angle, applied = t[moved], angle[moved], applied[moved]
    if len(t) < SHORTEST:
        return None
    expected = ExpectedAcceleration(profile)
    unmodelled = UNKNOWN * np.array(expected.typical)
    accelerations = [_accelerations(fault, angle, applied, profile, expected) for fault in FAULTS]
    normal = _accelerations(NORMAL, angle, applied, profile, expected)

    def scores(first: int, end: int) -> np.ndarray:
        """Return the score of each fault minus the score of a rig without fault.

        The scores are computed from the rows ``first`` to ``end`` − 1.
        """
        windows = _windows(angle, profile, first, end)
        of = partial(_score, t, angle, windows=windows, profile=profile, unmodelled=unmodelled)
        return np.array([of(alpha) for alpha in accelerations]) - of(normal)

    above_rest = angle[:, 0] - profile.encoder.rest_rad[0]
    was_above = profile.motor.V_o > 0 and above_rest.max() > BELOW_TABLE
    end = _last_free(t, angle, profile)
    starts = [end]
    while starts[-1] > SHORTEST:
        starts.append(int(np.searchsorted(t, t[starts[-1] - 1] - WINDOWS_S[0])))
    parts = [scores(first, last) for last, first in pairwise(starts)]
    possible = np.array([not (was_above and fault.keeps_on_table) for fault in FAULTS])
    sudden = np.array([fault.sudden for fault in FAULTS])
    for window_s in WINDOWS_S:
        window = scores(int(np.searchsorted(t, t[end - 1] - window_s)), end)
        earlier = np.sum(parts[round(window_s / WINDOWS_S[0]) :], axis=0)
        possible &= sudden | (earlier >= -SURE)
        ranked = np.where(possible, window, -np.inf)
        second, best = np.argsort(ranked)[-2:]
        least = max(SURE, ranked[second] + DISTINCT, window.max() - SURE)
        if ranked[best] > least:
            return FAULTS[int(best)]
    return None


def with_cause(trip: Trip, moments: Sequence[Moment], profile: Profile) -> Trip:
    """Return ``trip`` with a wiring fault as its cause if the ``moments`` before it show one."""
    fault = wiring_fault(moments, profile, trip.invalid_s) if trip.may_be_wiring_fault else None
    if fault is None:
        return trip
    return Trip(
        f"{fault.what}: {trip}",
        "of all wiring faults, only this one explains how the rig moved before the flight ended.",
        fault.fix,
    )


def _last_free(t: np.ndarray, angle: np.ndarray, profile: Profile) -> int:
    """Return the number of rows until the last one in which the axes were free to move.

    An arm that never left the table counts as free: pitch and yaw may turn there.
    """
    beyond = np.flatnonzero((np.abs(angle[:, 1]) > PITCH_STOP) & (t > t[-1] - 2 * WINDOWS_S[-1]))
    end = int(beyond[0]) if len(beyond) else len(t)
    height = np.abs(angle[:end, 0] - profile.encoder.rest_rad[0])
    above = np.flatnonzero(height > ON_TABLE)
    if len(above):
        landed = np.flatnonzero(height[above[-1] :] < ON_TABLE / 3)
        end = int(above[-1] + landed[0]) if len(landed) else end
    return end


def _windows(angle: np.ndarray, profile: Profile, first: int, end: int) -> dict[int, slice]:
    """Return the rows to fit for each axis (0 roll, 1 pitch, 2 yaw) that moved: axis → slice.

    They are the rows from ``first`` to ``end`` in which the axis was free to move.
    """
    rest = float(profile.encoder.rest_rad[0])
    q = np.abs(profile.encoder.rad_per_count)
    rows_of = {}
    for i in range(3):
        start = first
        if i == 0:
            # Near its rest angle the arm may lie on the table.
            on_table = np.flatnonzero(np.abs(angle[first:end, 0] - rest) < ON_TABLE / 3)
            start = first + (int(on_table[-1]) + 1 if len(on_table) else 0)
        rows = slice(start, end)
        if end - start >= SHORTEST and np.ptp(angle[rows, i]) >= MOVED * q[i]:
            rows_of[i] = rows
    return rows_of


def _accelerations(
    fault: Fault,
    angle: np.ndarray,
    applied: np.ndarray,
    profile: Profile,
    expected: ExpectedAcceleration,
) -> np.ndarray:
    """Return the accelerations α_H (n, 3) in rad/s² that the encoders would show with ``fault``."""
    rest, sign = profile.encoder.rest_rad, np.array(fault.sign)
    true = (rest + sign * (angle - rest)).tolist()
    volts = (np.array(fault.mix, dtype=float) @ applied.T).tolist()
    shown: np.ndarray = sign * np.array([expected(*m) for m in zip(true, *volts, strict=True)])
    return shown


def _score(
    t: np.ndarray,
    angle: np.ndarray,
    alpha: np.ndarray,
    windows: dict[int, slice],
    profile: Profile,
    unmodelled: np.ndarray,
) -> float:
    """Return the log-likelihood of the measured angles under one hypothesis (wiring fault or none).

    ``alpha``: accelerations α_H (n, 3) in rad/s² under this hypothesis. ``windows``: axis → rows to
    fit. ``unmodelled``: B (3,) in rad/s², each axis's standard deviation of the unmodelled
    acceleration.
    """
    q = np.abs(profile.encoder.rad_per_count)
    score = 0.0
    for i, rows in windows.items():
        n = (t[rows][-1] - t[rows][0]) / INDEPENDENT_S
        squared, b = _fit(t[rows], angle[rows, i], alpha[rows, i], q[i] / unmodelled[i])
        score -= 0.5 * (n * np.log(squared + q[i] ** 2 / 12) + (b / unmodelled[i]) ** 2)
    return float(score)


def _fit(t: np.ndarray, theta: np.ndarray, alpha: np.ndarray, weight: float) -> tuple[float, float]:
    """Fit θ₀ + ω₀ t + ½ b t² + s ∬ α dt² to the angle of one axis, by least squares.

    Returns the mean squared residual in rad² and the unmodelled acceleration b in rad/s².
    ``theta`` (n,): the angle in rad; ``alpha`` (n,): α in rad/s². ``weight``: the weight in s² with
    which b counts as a residual, (encoder step in rad)/(standard deviation of b in rad/s²).
    """
    h = np.diff(t, prepend=t[0])
    tau = t - t[0]
    double = np.append(np.cumsum(np.cumsum(alpha * h) * h), 0.0)
    base = np.column_stack([np.ones_like(tau), tau, 0.5 * tau**2])
    base = np.vstack([base, [0.0, 0.0, weight]])
    theta = np.append(theta, 0.0)
    s = np.linalg.lstsq(np.column_stack([base, double]), theta, rcond=None)[0][3]
    rest = theta - float(np.clip(s, *GAIN)) * double
    fit = np.linalg.lstsq(base, rest, rcond=None)[0]
    return float(np.mean((rest - base @ fit)[:-1] ** 2)), float(fit[2])
