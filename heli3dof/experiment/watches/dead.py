"""An encoder that lived and is dead: what turned its axis before in this flight turns it no more.

How much dry friction an axis has is read from its own motion. Its count turns back again and again
(by 2 counts and more each way: a count on an edge may chatter by one); from one turn to the next
what drives it, d (see `Frozen`), swings by some range. An axis that friction F holds while
|d − d₀| < F is not turned by swings of less than 2F, so over the last `SWINGS` turns

    2F  ≤  R = the largest range of d's means over `BLOCK_S` from one turn to the next

**Driven**: its count stands still, though d has ranged over more than `TIMES` R since, and by two
means over h seconds each that differ by more than D(h) = 16 q J / (h² k): what turns the axis by
8 counts if nothing holds it (k: the drive's torque, as in `Frozen`).

**Silent**: no such swing comes, for who flies sees no error. R is less than `LITTLE` of what dry
friction could hold (`Frozen`), its swings did not die away, and no standstill of the last
`REMEMBERED_S` was longer than L. Now it stands still for longer than max(`SILENT_S`, `LONGER` L).

On the table, and until it has turned often enough, nothing is known and nothing is said. A rig that
sticks turns by swings of 2F or comes to rest with R from larger ones; one that comes to rest
without friction does so by swings that die away.
"""

from __future__ import annotations

from array import array
from collections import deque
from math import inf

from heli3dof.axes import AXES
from heli3dof.experiment.period import Period
from heli3dof.experiment.watches.encoders import (
    AT_REST_RAD,
    COUNTS,
    friction,
    inertia_per_drive,
)
from heli3dof.rig.profile import Profile
from heli3dof.rig.trip import Trip

BLOCK_S = 0.1
TURN = 2
"""counts, each way"""
SWINGS = 8
REMEMBERED_S = 40.0
TIMES = 4.0
"""An encoder with play misses small turns, and takes larger swings to show them."""
SILENT_S = 6.0
LONGER = 6.0
LITTLE = 0.2
DYING = 0.7
"""of the swings' counts: the later half's to the earlier half's"""
SHORTEST, LONGEST = 4, 1200
"""blocks that a standstill lasts before it is judged; and after which nothing is known any more"""
DRIVES = ("the sum of the voltages", "the difference of the voltages", "the pitch angle")


class Dead:
    """Learns from each axis's turns in the air, and compares its standstills with them."""

    def __init__(self, profile: Profile) -> None:
        periods = max(1, round(BLOCK_S / profile.dt))
        q = abs(profile.encoder.rad_per_count).tolist()
        self._axes = tuple(
            _Life(periods, periods * profile.dt, 2 * COUNTS * q[i] * each)
            for i, each in enumerate(inertia_per_drive(profile))
        )
        self._little = tuple(LITTLE * each for each in friction(profile))
        self._low = profile.encoder.rest_rad.tolist()[0] + AT_REST_RAD

    def __call__(self, now: Period) -> str | None:
        counts, axes = now.sample.counts, self._axes
        if now.angle[0] <= self._low:
            for i in range(3):
                axes[i].begin(counts[i])
            return None
        front, back = now.sample.v_applied
        drives = (front + back, front - back, now.angle[1])
        for i in range(3):
            axis = axes[i]
            if axis.take(counts[i], drives[i]) and (why := self._judged(i)):
                return Trip(
                    f"the {AXES[i]} encoder is frozen: its count stood at {counts[i]} for "
                    f"{axis.still_s:.2g} s {why}",
                    "its cable is out or its supply gone, or its disc slips; or something holds "
                    "an axis that moved before.",
                    f"heli3dof monitor and turn {AXES[i]} by hand: does its angle follow?",
                )
        return None

    def _judged(self, i: int) -> str | None:
        axis = self._axes[i]
        known = axis.known()
        if known is None:
            return None
        largest, longest_s, dying = known
        if axis.movable and axis.spread > TIMES * largest:
            times = axis.spread / largest
            return f"while {DRIVES[i]} changed by {times:.1f} times what turned it before"
        silent_s = max(SILENT_S, LONGER * longest_s)
        if largest < self._little[i] and not dying and axis.still_s > silent_s:
            return f"and turned to and fro before, never still for longer than {longest_s:.1f} s"
        return None


class _Life:
    """One axis."""

    def __init__(self, periods: int, block_s: float, moves_s2: float) -> None:
        self._periods, self._block_s = periods, block_s
        self._horizon = round(REMEMBERED_S / block_s)
        self._moves_s2 = moves_s2
        """D(h) h²"""
        self._sums = array("d", bytes(8 * (LONGEST + 2)))
        """of the drive's means since the count stands still, in room that is taken once"""
        self.begin(0)

    def begin(self, count: int) -> None:
        """Nothing is known."""
        self._count = self._extreme = self._turned_at = count
        self._way = self._n = self._blocks = 0
        self._sum = 0.0
        self._mean: float | None = None
        self._low, self._high = inf, -inf
        """of the drive's block means since the last turn"""
        self._swings: deque[tuple[int, float, int]] = deque(maxlen=SWINGS)
        """(block, range of the drive, counts) of each way from one turn to the next"""
        self._stood: deque[tuple[int, int]] = deque()
        """(block, blocks) of standstills that ended, each longer than those after it"""
        self._moved = True
        self._stand()

    def _stand(self) -> None:
        self._still = 0
        """blocks that the count stands still"""
        self._least, self._most = inf, -inf
        self.movable = False
        """Without friction it would have moved"""

    @property
    def still_s(self) -> float:
        return self._still * self._block_s

    @property
    def spread(self) -> float:
        return self._most - self._least

    def take(self, count: int, drive: float) -> bool:
        """One period; True at the end of a block that the count stood still in, long enough."""
        if count != self._count:
            self._count, self._moved = count, True
            if (count - self._extreme) * self._way > 0:
                self._extreme = count
            elif abs(count - self._extreme) >= TURN:
                self._turn(count)
        self._sum += drive
        self._n += 1
        return self._n == self._periods and self._block()

    def _turn(self, count: int) -> None:
        if self._way and self._high > self._low:
            counts = abs(self._extreme - self._turned_at)
            self._swings.append((self._blocks, self._high - self._low, counts))
        self._way = 1 if count > self._extreme else -1
        self._turned_at, self._extreme = self._extreme, count
        self._low, self._high = inf, -inf
        if self._mean is not None:
            self._low = self._high = self._mean

    def _block(self) -> bool:
        mean = self._mean = self._sum / self._n
        self._n, self._sum = 0, 0.0
        self._blocks += 1
        self._low, self._high = min(self._low, mean), max(self._high, mean)
        n = self._still + 1
        if self._moved:
            self._moved = False
            while self._stood and self._stood[-1][1] <= n:
                self._stood.pop()
            self._stood.append((self._blocks, n))
            self._stand()
            return False
        if n > LONGEST:
            self.begin(self._count)
            return False
        self._sums[n] = self._sums[self._still] + mean
        self._still = n
        self._least, self._most = min(self._least, mean), max(self._most, mean)
        if not self.movable:
            self.movable = self._would_move(n)
        return n >= SHORTEST

    def _would_move(self, n: int) -> bool:
        """Of the last 2, 4, 8 … of n blocks: do the halves' means differ by more than D(h)?"""
        sums, h = self._sums, 1
        while 2 * h <= n:
            differ = abs(sums[n] - 2 * sums[n - h] + sums[n - 2 * h]) / h
            if differ > self._moves_s2 / (h * self._block_s) ** 2:
                return True
            h *= 2
        return False

    def known(self) -> tuple[float, float, bool] | None:
        """(R, L in s, do its swings die away); None where it has not turned often enough."""
        first = self._blocks - self._still - self._horizon
        while self._stood and self._stood[0][0] < first:
            self._stood.popleft()
        swings = self._swings
        if len(swings) < SWINGS or swings[0][0] < first:
            return None
        half = SWINGS // 2
        early, late = (sum(s[2] for s in list(swings)[a : a + half]) for a in (0, half))
        longest = self._stood[0][1] if self._stood else 0
        return max(s[1] for s in swings), longest * self._block_s, late < DYING * early
