"""Encoders that do not tell the truth: counts that jump, counts that stand still.

**Jump.** Within Δt an axis turns by no more than its rate allows, and a count more or less:

    |Δcounts| · q  >  2 · rate_max · Δt + 2 q      q: rad per count

rate_max is the profile's ``[limits]``; twice of it, for the envelope judges a filtered rate.
A smaller jump that stays cannot be told from motion, by these means.

**Frozen.** What drives an axis is d = V_f + V_b for roll, V_f − V_b for pitch, the pitch angle for
yaw. Its means over blocks of T spread, since the count last changed, over more than

    D = max(what turns the axis by 8 counts within T, what dry friction could hold)

=====  ======  ==================================  ================
axis   T       8 counts within T                   friction
=====  ======  ==================================  ================
roll   0.25 s  16 q J_roll / (T² L_a K_f)          V_o
pitch  0.1 s   16 q J_pitch / (T² L_h K_f)         V_o
yaw    0.25 s  16 q J_yaw / (T² 2 L_a K_f V_o)     10°
=====  ======  ==================================  ================

and a whole block later the count is still the same. Differences, not values: a wrong hover
voltage, a lopsided body or a cable may ask for any steady drive. On the table the encoders stand
still by right; there only roll is judged, by a sum of more than 3.2 V_o over T, which lifts a rig
of 0.6 times its thrust. In a calm hover a frozen encoder is found when the drive next changes, or
by `Dead`.
"""

from __future__ import annotations

from math import inf, pi, radians

from heli3dof.axes import AXES
from heli3dof.experiment.period import Period
from heli3dof.rig.profile import Profile
from heli3dof.rig.trip import Trip

AT_REST_RAD = radians(3.0)
"""A roll angle closer than this to the rest angle may be on the table."""
LIFTS = 3.2
"""times V_o, both motors together: no rig stays on the table"""
COUNTS = 8
"""A motion that no encoder misses"""


def inertia_per_drive(profile: Profile) -> tuple[float, float, float]:
    """J / k of each axis: its drive (V, V, rad) for an acceleration of 1 rad/s²."""
    L, K_f, (J_roll, J_pitch, _) = profile.geometry, profile.motor.K_f, profile.inertias
    per_V = L.L_a * K_f
    return (
        J_roll / per_V,
        J_pitch / (L.L_h * K_f),
        J_roll / (2 * per_V * _hover(profile)),
    )


def friction(profile: Profile) -> tuple[float, float, float]:
    """The drive (V, V, rad) that dry friction could hold on each axis."""
    return _hover(profile), _hover(profile), radians(10.0)


def _hover(profile: Profile) -> float:
    return max(profile.motor.V_o, profile.motor.v_max / 8)


class Jump:
    """A count that changed by more than the rig can turn."""

    def __init__(self, profile: Profile) -> None:
        limits, q = profile.limits, profile.encoder.rad_per_count.tolist()
        rates = (
            limits.roll_rate_max_deg_per_s,
            limits.pitch_rate_max_deg_per_s,
            limits.yaw_rate_max_deg_per_s,
        )
        self._per_s = tuple(2 * radians(rate) / abs(q[i]) for i, rate in enumerate(rates))
        self._before: tuple[int, int, int] | None = None
        self._t = 0.0

    def __call__(self, now: Period) -> str | None:
        counts, t = now.sample.counts, now.t
        before, dt = self._before, t - self._t
        self._before, self._t = counts, t
        if before is None:
            return None
        for i in range(3):
            moved = counts[i] - before[i]
            if abs(moved) > self._per_s[i] * dt + 2:
                return Trip(
                    f"the {AXES[i]} encoder jumped by {moved} counts within {1e3 * dt:.1f} ms",
                    "its cable or connector is loose, or the device lost counts.",
                    "heli3dof monitor while its cable is moved; then heli3dof zero",
                )
        return None


class Frozen:
    """A count that stands still while its axis is driven."""

    def __init__(self, profile: Profile) -> None:
        q = abs(profile.encoder.rad_per_count).tolist()
        hover, dt = _hover(profile), profile.dt
        blocks = (0.25, 0.1, 0.25)
        per_drive = inertia_per_drive(profile)
        held = friction(profile)
        spread = (max(2 * COUNTS * q[i] * per_drive[i] / blocks[i] ** 2, held[i]) for i in range(3))
        self._axes = tuple(
            _Stillness(i, max(2, round(blocks[i] / dt)), d) for i, d in enumerate(spread)
        )
        self._low = profile.encoder.rest_rad.tolist()[0] + AT_REST_RAD
        self._lifts = LIFTS * hover
        self._dt = dt

    def __call__(self, now: Period) -> str | None:
        front, back = now.sample.v_applied
        roll, pitch, _ = now.angle
        flying = roll > self._low
        drives = (front + back, front - back, pitch)
        for axis, drive in zip(self._axes, drives, strict=True):
            done = axis.take(now.sample.counts[axis.axis], drive, flying)
            if not done:
                continue
            if axis.frozen:
                return self._said(axis, f"{self._changed(axis)}, and it was in the air")
            if axis.axis == 0 and not flying and axis.still == 1 and axis.mean > self._lifts:
                return self._said(axis, f"{axis.mean:.1f} V lifted the rig off the table")
        return None

    def _said(self, axis: _Stillness, why: str) -> str:
        name, seconds = AXES[axis.axis], axis.still * axis.periods * self._dt
        return Trip(
            f"the {name} encoder is frozen: its count stood at {axis.count} for {seconds:.2g} s "
            f"while {why}",
            "its cable is out, its supply is gone, or its disc slips on the shaft; or a stop, or "
            "something else, holds the axis.",
            f"heli3dof monitor and turn {name} by hand: does its angle follow?",
        )

    def _changed(self, axis: _Stillness) -> str:
        if axis.axis == 2:
            return f"the pitch angle changed by {axis.spread * 180 / pi:.0f}°"
        what = "sum" if axis.axis == 0 else "difference"
        return f"the {what} of the voltages changed by {axis.spread:.1f} V"


class _Stillness:
    """One axis: how far its drive's block means have spread since its count last changed."""

    def __init__(self, axis: int, periods: int, enough: float) -> None:
        self.axis, self.periods, self._enough = axis, periods, enough
        self.count = 0
        self.still = 0
        """Whole blocks without a change of the count"""
        self.mean = self.spread = 0.0
        self.frozen = False
        self._n, self._sum, self._moved = 0, 0.0, True
        self._low, self._high = inf, -inf

    def take(self, count: int, drive: float, flying: bool) -> bool:
        """One period; True at the end of a block, when the attributes are new."""
        if count != self.count or not flying:
            self._moved = self._moved or count != self.count
            self.count = count
            self._low, self._high = inf, -inf
        self._sum += drive
        self._n += 1
        if self._n < self.periods:
            return False
        self.mean, moved = self._sum / self._n, self._moved
        self._n, self._sum, self._moved = 0, 0.0, False
        if moved:
            self.still = 0
            self.frozen = False
            return True
        self.still += 1
        self.frozen = self._high - self._low > self._enough
        self.spread = max(0.0, self._high - self._low)
        if flying:
            self._low, self._high = min(self._low, self.mean), max(self._high, self.mean)
        return True
