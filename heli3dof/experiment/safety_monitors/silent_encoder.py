"""Detects an encoder whose count changed often in calm flight, but not in the ramp to zero.

The ramp to zero ends every flight: the loop lowers the voltages of both motors to zero.

A standstill is a time in which a count is constant. Even on a calm axis, the count wanders by one
or two. The standstills end at random, at a rate λ, so the longest of N standstills is about
L = (ln N)/λ. The probability that one of N standstills lasts longer than T is about N exp(−λ T).
This probability is below ε if

    T > L (1 + ln(1/ε) / ln N)

The monitor reports pitch or yaw if its count is constant for longer than T, and at least for two
seconds, during the ramp to zero while the arm is in the air. In the ramp the loop is open, so these
axes drift, and a working encoder shows this drift. The monitor does not report an axis that did not
wander before the ramp, because dry friction may hold this axis. In the ramp the arm must fall, so
a constant roll count shows a frozen encoder without this statistical test; `FrozenEncoder` reports
it.
"""

from __future__ import annotations

from collections import deque
from math import log

from heli3dof.axes import AXES, PITCH, YAW
from heli3dof.experiment.control_loop.control_period import Period
from heli3dof.experiment.safety_monitors import SafetyMonitor
from heli3dof.experiment.safety_monitors.axis_observer import ON_TABLE
from heli3dof.experiment.safety_monitors.frozen_encoder import frozen_trip
from heli3dof.rig.profile import Profile

FALSE_ALARM = 1e-3
"""ε: share of ramps in which a working encoder may be reported"""
CALM = 4
"""counts: an axis is calm while its count varies by no more than this within `WINDOW_S`"""
WINDOW_S = 1.0
PIECES = 10
"""Number of parts of the window; the range of the counts is stored for each part"""
STANDSTILLS, REVERSALS = 10, 3
"""Least numbers of calm standstills and of reversals that show that an axis wanders"""
LEAST_S = 2.0
"""s, lower bound of T: without the controller, random torques alone move an axis by a count
within 1.2 s (measured on emulated rigs)"""
SHORTEST_S = 0.01
"""s: a shorter standstill belongs to a limit cycle on one count and is not counted"""


class SilentEncoder(SafetyMonitor):
    """Safety monitor: trips if pitch's or yaw's count is constant too long in the ramp to zero.

    The ramp to zero ends a flight: the loop lowers the voltages of both motors to zero.
    """

    order = 60

    def __init__(self, profile: Profile) -> None:
        self._axes = {PITCH: _Axis(), YAW: _Axis()}
        self._low = profile.encoder.rest_rad.tolist()[0] + ON_TABLE

    def __call__(self, now: Period) -> str | None:
        counts, t = now.sample.counts, now.t
        if now.angle[0] <= self._low:
            for i, axis in self._axes.items():
                axis.restart(counts[i], t)
            return None
        for i, axis in self._axes.items():
            axis.step(counts[i], t, now.ramping_down)
            if now.ramping_down and (still_s := t - axis.since) > axis.longest_credible_s():
                return frozen_trip(
                    i,
                    f"the {AXES[i]} encoder's count stood at {counts[i]} for {still_s:.2g} s, the "
                    f"ramp to zero included; before, it changed every {axis.longest_s:.2g} s or "
                    "sooner",
                )
        return None


class _Axis:
    def __init__(self) -> None:
        self._n = self._reversals = 0
        self.longest_s = 0.0
        """L, the longest standstill so far, in s"""
        self.restart(0, 0.0)

    def restart(self, count: int, t: float) -> None:
        """Restart the observation of the axis; its encoder shows ``count`` at time ``t`` (s)."""
        self._count, self.since = count, t
        self._from_change = False  # the beginning of this standstill is unknown
        self._way = 0
        self._range = deque([(count, count)] * PIECES, maxlen=PIECES)
        self._piece_t = t
        self._calm_from = t + WINDOW_S

    def step(self, count: int, t: float, ramping_down: bool) -> None:
        """Update the axis with its encoder's ``count`` at time ``t`` (s); the arm is in the air."""
        if t - self._piece_t > WINDOW_S / PIECES:
            self._piece_t = t
            self._range.append((count, count))
        if count == self._count:
            return
        low, high = self._range[-1]
        self._range[-1] = (min(low, count), max(high, count))
        if self._from_change and not ramping_down:
            self._ended(count, t - self.since, t)
        self._count, self.since, self._from_change = count, t, True

    def _ended(self, count: int, seconds: float, t: float) -> None:
        self.longest_s = max(self.longest_s, seconds)
        way = 1 if count > self._count else -1
        lows, highs = zip(*self._range, strict=True)
        if t > self._calm_from and max(highs) - min(lows) <= CALM:
            self._n += seconds > SHORTEST_S
            self._reversals += way != self._way
        self._way = way

    def longest_credible_s(self) -> float:
        """Return T in s, the longest time for which a working encoder's count may stay constant.

        T is at least `LEAST_S`. T is infinite if too few standstills of the count or reversals of
        the axis were observed to estimate T. T is also infinite if the count has not changed since
        `restart`.
        """
        if self._n < STANDSTILLS or self._reversals < REVERSALS or not self._from_change:
            return float("inf")
        return max(LEAST_S, self.longest_s * (1 + log(1 / FALSE_ALARM) / log(self._n)))
