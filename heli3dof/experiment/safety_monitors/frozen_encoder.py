"""Detects an encoder whose count stays constant although its axis must be turning.

While a count stays constant, the monitor simulates a model of the axis. The simulation starts from
the state that an observer had estimated at the last change of the count
(`heli3dof.experiment.safety_monitors.axis_observer`). The model has more dry friction than the axis
has shown so far in this flight. So the real axis turns at least as far as the model::

    ω̇ = α + b − f sgn(ω)      at rest while |α + b| ≤ f       f = F + 0.25 |α + b|      (rad/s²)

ω is the model's rate. α is the expected acceleration under the voltages at the motors. The observer
also estimates the unmodelled acceleration, the measured one minus α; b is its mean. f is the dry
friction divided by the inertia. Its part F is estimated as described below. The part 0.25 |α + b|
covers an error of thrust or inertia by a quarter.

The monitor reports the encoder as frozen when the model has turned by more than the clearance C. C
is an angle that the model may turn while a working encoder's count stays constant, because of
backlash and delay.

F starts at the largest dry friction of known rigs, C at 1.2°, which exceeds the backlash of known
rigs. The monitor then estimates F and C from the axis's own motion:

* The unmodelled accelerations in upward and in downward motion differ by 2 F₀, whatever b is. F₀ is
  the axis's own friction. After half a second in each direction F = F_min + 3 |F₀|. The constant
  F_min (`F_MIN`) covers errors of F₀.
* To reverse its motion, an axis needs a change of α of at least 2 F₀. F is at most the
  third-smallest change of α that preceded a reversal.
* F is at least the largest deviation of the unmodelled acceleration from b while the axis moved.
  The stored deviation decays to 1/e in `PEAK_S` seconds.
* The monitor notes how far the model turns each time that the count stays constant. Let s be the
  largest of these angles since the axis last reversed its motion. S is the largest s so far; it
  decays by 2 % at each reversal. C is at least 2 S plus 3 counts.

A flight may begin while the arm still falls after the last flight. Then the observer does not know
the arm's rate. The observer does not know the rate after a gap of samples, either. In the air, the
monitor checks no encoder until the observer has found the rate (`SETTLING`).

On the table, friction may hold pitch and yaw, so the monitor does not check their encoders there.
It checks the roll encoder there only at voltages that lift the arm of every known rig. If the
motors push an axis against its mechanical stop, the report names the stop, not the encoder. During
the ramp to zero, the monitor does not report an axis at its stop.

There was no false alarm in 10 h of emulated flight, half in hover and half in plan `rich`. The
rigs' parameters differed by up to 15 % from the profile. Detection times are in
docs/results/benchmarks.md (`make bench TOPIC=watches`).
"""

from __future__ import annotations

from math import degrees, inf, radians

from heli3dof.axes import AXES
from heli3dof.experiment.control_loop.control_period import Period
from heli3dof.experiment.safety_monitors import SafetyMonitor
from heli3dof.experiment.safety_monitors.axis_observer import (
    BANDWIDTH,
    LONGEST_GAP_S,
    ON_TABLE,
    PITCH_STOP,
    AxisObserver,
    ExpectedAcceleration,
)
from heli3dof.rig.profile import Profile
from heli3dof.rig.trip import Trip

LIFTS = 3.2
"""Sum of both motor voltages, divided by V_h, at which even a rig with 0.6 of the nominal thrust
lifts its arm"""
ROLL_STOP = radians(30.0)
"""rad: roll beyond it may be at its mechanical stop (known rigs: +36°)"""
AT_STOP_S = 0.5
"""s that the motors may push an axis against its stop: a large step on a slow rig touches it"""
F_MIN = tuple(radians(a) for a in (3.0, 10.0, 0.5))
"""rad/s² (roll, pitch, yaw), added to F: error of F₀ by random torques and quantisation"""
MISMATCH = 0.25
"""Possible relative error of the expected acceleration: thrust gain and inertia by ±15 % each"""
CLEARANCE = radians(1.2)
"""rad, the smallest C: couplings have up to 1° of backlash"""
SMALLEST = 3
"""Rank, counted from the smallest, of the change of α that bounds F (see the module's docstring)"""
MOVING = 25
"""counts/s: three standard deviations of the observer's rate on an axis at rest"""
RATE_ERROR = (7, 13, 7)
"""counts/s (roll, pitch, yaw): two standard deviations of the error of the observer's rate at the
last change of a count"""
KNOWN_S = 0.5
"""s of motion in each direction after which F₀ is known"""
BIAS_S = 2.0
"""s over which the unmodelled acceleration is averaged"""
PEAK_S = 3.0
"""s in which the stored largest deviation from b decays to 1/e: longer than a step lasts"""
SETTLING = 8.0
"""Ωt at which the observer has forgotten an error of its initial rate: three equal poles leave
about (Ωt)² exp(−Ωt) of it, here 2 %. t is 0.53 s for the smallest Ω."""
LIVE_S = 0.3
"""s: a count that stays constant for longer shows nothing of the unmodelled acceleration"""
BLOCK_S = 0.05
"""s over which α is averaged before its range between two turns is taken"""
MOST_FRICTION = (0.35, 1.0, 1.0)
"""Largest friction of known rigs (roll, pitch, yaw) / `ExpectedAcceleration.typical`"""


def frozen_trip(
    axis: int, what: str, *, may_be_wiring_fault: bool = False, invalid_s: float = 0.0
) -> Trip:
    """Return the `Trip` for a frozen encoder on ``axis`` (0 roll, 1 pitch, 2 yaw).

    ``what``: describes the evidence. ``may_be_wiring_fault``: True if a wiring fault, such as
    swapped motor leads, may have caused the trip. ``invalid_s``: the encoder's angles in the last
    ``invalid_s`` seconds before the trip are invalid, because it was frozen while the arm was in
    the air.
    """
    return Trip(
        what,
        "the encoder is frozen: its cable is out, its supply is gone, or its disc slips on the "
        "shaft; or something holds the axis.",
        f"heli3dof monitor and turn {AXES[axis]} by hand: does its angle follow?",
        may_be_wiring_fault=may_be_wiring_fault,
        invalid_s=invalid_s,
    )


class FrozenEncoder(SafetyMonitor):
    """Safety monitor that detects a frozen encoder on any axis.

    It is also active while the voltages ramp to zero at the end of a flight.
    """

    order = 50

    def __init__(self, profile: Profile) -> None:
        expected = self._expected = ExpectedAcceleration(profile)
        q = abs(profile.encoder.rad_per_count).tolist()
        self._axes = tuple(_Axis(i, q[i], MOST_FRICTION[i] * expected.typical[i]) for i in range(3))
        self._low = profile.encoder.rest_rad.tolist()[0] + ON_TABLE
        self._lifts = LIFTS * expected.hover_V
        self._t: float | None = None
        self._settled_t = 0.0
        self._airborne = False

    def __call__(self, now: Period) -> str | None:
        t, angle, counts = now.t, now.angle, now.sample.counts
        axes = self._axes
        h = 0.0 if self._t is None else t - self._t
        self._t = t
        if not 0.0 < h < LONGEST_GAP_S:
            self._settled_t = t + SETTLING / min(BANDWIDTH) if angle[0] > self._low else t
            for i in range(3):
                axes[i].restart(counts[i], angle[i])
            return None
        front, back = now.motor_V
        alpha = self._expected(angle, front, back)
        self._airborne = angle[0] > self._low
        if not self._airborne:
            lift = self._expected.roll_per_V * (front + back - self._lifts)
            axes[0].on_table(h, counts[0], angle[0], lift)
            axes[1].restart(counts[1], angle[1])
            axes[2].restart(counts[2], angle[2])
        elif t < self._settled_t:
            for i in range(3):
                axes[i].settle(h, alpha[i], counts[i], angle[i])
        else:
            for i in range(3):
                axes[i].step(h, alpha[i], counts[i], angle[i])
        for i in range(3):
            axis = axes[i]
            if abs(axis.moved) > axis.clearance and (trip := self._report(i, now)):
                return trip
        return None

    def awaits_fall(self) -> bool:
        """Return True if the arm is in the air and the roll count constant for over `LIVE_S` s."""
        return self._airborne and self._axes[0].still_s > LIVE_S

    def _report(self, i: int, now: Period) -> Trip | None:
        axis, at = self._axes[i], now.angle[i]
        name, seconds = AXES[i], axis.still_s
        outward = at * axis.moved > 0
        if outward and ((i == 0 and at > ROLL_STOP) or (i == 1 and abs(at) > PITCH_STOP)):
            if now.ramping_down or seconds < AT_STOP_S:
                return None
            return Trip(
                f"{name} stood at {degrees(at):.1f}° for {seconds:.2g} s while the motors pushed "
                "it further: it is at its mechanical stop",
                "control was lost: the sign of an encoder, the sign or the order of the motors' "
                "leads, or a motor that does not pull.",
                f"heli3dof monitor and turn {name} by hand: does its angle follow, with its sign?",
                may_be_wiring_fault=True,
            )
        what = (
            f"the {name} encoder's count stood at {axis.count} for {seconds:.2g} s while the "
            f"voltages turned the axis by {degrees(abs(axis.moved)):.2g}° at least"
        )
        if self._airborne:
            return frozen_trip(i, what, may_be_wiring_fault=True, invalid_s=seconds)
        return Trip(
            f"{what}, with the arm on the table",
            "no motor pulls (supply, fuse, plug), one does not, something holds the arm, or the "
            "encoder is frozen.",
            "check the amplifier's supply and fuses with both rotors free; then heli3dof monitor "
            "and turn roll by hand: does its angle follow?",
            may_be_wiring_fault=True,
        )


class _Axis:
    """Computes a lower bound of an axis' motion since the last change of its encoder's count.

    The object contains the observer of the axis's motion and estimates of two numbers. F is the dry
    friction divided by the inertia (rad/s²). The clearance C is an angle (rad) that the axis may
    turn while a working encoder's count stays constant.

    ``i``: 0 roll, 1 pitch, 2 yaw; ``q``: rad per count; ``largest_f``: upper limit of F in rad/s².
    """

    def __init__(self, i: int, q: float, largest_f: float) -> None:
        self._observer = AxisObserver(BANDWIDTH[i])
        self._q, self._largest_f, self._f_min = q, largest_f, F_MIN[i]
        self._moving, self._rate_error = MOVING * q, RATE_ERROR[i] * q
        self._f_of_turns = largest_f
        """rad/s²: upper limit of F from the changes of α that preceded a reversal of the axis"""
        self._peak = self._peak_now = 0.0
        """rad/s²: largest deviation of the unmodelled acceleration from b until the last change of
        the count (`_peak`), and since then (`_peak_now`)"""
        self._direction = [0.0, 0.0]
        """∫ (unmodelled acceleration) dt in rad/s while moving down, and up"""
        self._direction_s = [0.0, 0.0]
        self._smallest = [inf] * SMALLEST
        self._largest = 0.0
        self.clearance = CLEARANCE
        """C in rad"""
        self.restart(0, 0.0)

    def restart(self, count: int, angle: float) -> None:
        """Restart the observer at rest, at ``angle`` (rad) and encoder ``count``.

        The estimates of the dry friction and of the clearance do not change. The clearance is the
        angle that the axis may turn while a working encoder's count stays constant.
        """
        self._observer.restart(angle)
        self.count = count
        self._bias = self._bias_s = 0.0
        self._extreme, self._way = count, 0
        self._low, self._high = inf, -inf
        self._sum = self._sum_s = 0.0
        self._swing = 0.0
        self._begin_standstill()

    def settle(self, h: float, alpha: float, count: int, angle: float) -> None:
        """Update the motion observer with a sample, without checking the encoder.

        ``h``: s since the last sample; ``alpha``: expected acceleration α (rad/s²); ``count``:
        the encoder's count; ``angle``: the encoder's angle in rad.
        """
        self._observer.step(h, alpha, angle)
        self.count = self._extreme = count
        self._begin_standstill()

    def _begin_standstill(self) -> None:
        self.still_s = 0.0
        self.moved = 0.0
        """rad that the model has turned since the last change of the count"""
        rate, error = self._observer.rate, self._rate_error
        self._rate = rate - error if rate > error else rate + error if rate < -error else 0.0
        self._centre = self._bias
        self._mean = 0.0
        self._peak, self._peak_now = max(self._peak, self._peak_now), 0.0
        self._friction = self._estimated_friction()

    def on_table(self, h: float, count: int, angle: float, lift: float) -> None:
        """Update ``moved`` (rad): a lower bound of roll's motion since the count last changed.

        The bound is the motion of a model that starts at rest and has the acceleration ``lift``.
        Use this method instead of `step` while the arm may lie on the table.

        ``h``: s since the last sample; ``count``: the encoder's count; ``angle``: the encoder's
        angle in rad. ``lift`` (rad/s²) is proportional to V − V_w. V is the sum of both motor
        voltages. V_w is the sum at which even the weakest known rig lifts its arm.
        """
        if count != self.count:
            self.restart(count, angle)
            return
        self.still_s += h
        self._rate = max(0.0, self._rate + lift * h)
        self.moved += self._rate * h

    def step(self, h: float, alpha: float, count: int, angle: float) -> None:
        """Update this object with a sample taken while the arm is in the air.

        ``h``: s since the last sample; ``alpha``: expected acceleration α (rad/s²); ``count``:
        the encoder's count; ``angle``: the encoder's angle in rad.
        """
        observer = self._observer
        observer.step(h, alpha, angle)
        self._peak -= self._peak * h / PEAK_S
        if self.still_s < LIVE_S:
            self._add_unmodelled(h, observer.rate, observer.unmodelled)
        self._range_of_drive(h, alpha)
        if count != self.count:
            self._count_changed(count)
            return
        self.still_s += h
        if self._bias_s < KNOWN_S:
            # b is not known yet: the mean α of the standstill's first half second replaces −b.
            if self.still_s < KNOWN_S:
                self._mean += (alpha - self._mean) * h / self.still_s
            drive = alpha - self._mean
        else:
            drive = alpha + self._centre
        friction = self._friction if self._friction > self._peak else self._peak
        friction += MISMATCH * abs(drive)
        rate = self._rate
        if rate > 0.0:
            rate = max(0.0, rate + (drive - friction) * h)
        elif rate < 0.0:
            rate = min(0.0, rate + (drive + friction) * h)
        elif drive > friction:
            rate = (drive - friction) * h
        elif drive < -friction:
            rate = (drive + friction) * h
        self._rate = rate
        if rate:
            self.moved += rate * h
            if abs(self.moved) > self._swing:
                self._swing = abs(self.moved)

    def _add_unmodelled(self, h: float, rate: float, unmodelled: float) -> None:
        """Update the statistics of the unmodelled acceleration: mean, largest deviation, sums.

        The unmodelled acceleration (rad/s²) is the observed one minus the expected one. It is
        summed separately for each direction of motion; the two sums give the dry friction.
        ``h``: s since the last sample; ``rate``: the axis's observed rate in rad/s.
        """
        self._bias_s += h
        over_s = self._bias_s if self._bias_s < BIAS_S else BIAS_S
        self._bias += (unmodelled - self._bias) * h / over_s
        deviation = abs(unmodelled - self._bias)
        if deviation > self._peak_now:
            self._peak_now = deviation
        if abs(rate) > self._moving:
            up = 1 if rate > 0 else 0
            self._direction[up] += unmodelled * h
            self._direction_s[up] += h

    def _estimated_friction(self) -> float:
        """Return an estimate of (dry friction)/(inertia) in rad/s², from the motion so far."""
        friction = min(self._largest_f, self._f_of_turns)
        down_s, up_s = self._direction_s
        if down_s > KNOWN_S and up_s > KNOWN_S:
            f0 = 0.5 * (self._direction[0] / down_s - self._direction[1] / up_s)
            friction = min(friction, self._f_min + 3.0 * abs(f0))
        return friction

    def _range_of_drive(self, h: float, alpha: float) -> None:
        self._sum += alpha * h
        self._sum_s += h
        if self._sum_s >= BLOCK_S:
            mean = self._sum / self._sum_s
            self._sum = self._sum_s = 0.0
            self._low, self._high = min(self._low, mean), max(self._high, mean)
            self._last_mean = mean

    def _count_changed(self, count: int) -> None:
        self.count = count
        if (count - self._extreme) * self._way > 0:
            self._extreme = count
        elif abs(count - self._extreme) >= 2:
            self._turn(count)
        self._begin_standstill()

    def _turn(self, count: int) -> None:
        """Update the estimates of dry friction and clearance when the axis has reversed its motion.

        The encoder has counted back by at least two counts, to ``count``. One count would not prove
        a reversal, because a limit cycle on one count also causes it. The clearance is the angle
        that the axis may turn while a working encoder's count stays constant.
        """
        if self._way and self._high >= self._low:
            change = self._high - self._low
            if change < self._smallest[-1]:
                self._smallest[-1] = change
                self._smallest.sort()
                self._f_of_turns = max(self._f_min, self._smallest[-1])
            self._largest = max(0.98 * self._largest, self._swing)
            self.clearance = max(CLEARANCE, 2.0 * self._largest + 3 * self._q)
            self._low = self._high = self._last_mean
        else:
            self._low, self._high = inf, -inf
        self._swing = 0.0
        self._way = 1 if count > self._extreme else -1
        self._extreme = count
