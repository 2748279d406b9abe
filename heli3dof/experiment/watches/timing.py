"""A loop that is too late to fly, and a line that loses what it should carry.

**Late**: of the last second's periods, more than ``late_max_share`` came later than ``late_max_s``
after their deadline; those that such a sample was too late for count with it.

**Lost**: for longer than ``lost_max_s`` no sample came though the host waited for it (lost on the
line, or left out by a device that was held up), or the samples that came echoed no new command.
"""

from __future__ import annotations

from heli3dof.experiment.period import Period
from heli3dof.rig.profile import Profile
from heli3dof.rig.trip import Trip

WINDOW_S = 1.0
LOSES = "a loose or long cable, a hub in between, or the motors' leads beside it."
BUSY = "the device has more to do than it has time for, or its program was stopped."
LOAD = "heli3dof doctor, and what it says of the device; a lower rate_hz in the profile"
LOOK = "heli3dof doctor, and what it says of loss; a shorter shielded cable away from the motors"


class Late:
    """A ring of the last second's periods: late or not."""

    def __init__(self, profile: Profile) -> None:
        limits = profile.limits
        self._late_s = limits.late_max_s
        self._ring = bytearray(max(2, round(WINDOW_S / profile.dt)))
        self._most = limits.late_max_share * len(self._ring)
        self._at = self._late = 0

    def __call__(self, now: Period) -> str | None:
        late = now.lateness > self._late_s
        if not late and not self._late:
            return None
        for _ in range(1 + (min(now.missed - now.left_out, len(self._ring)) if late else 0)):
            self._late += late - self._ring[self._at]
            self._ring[self._at] = late
            self._at = (self._at + 1) % len(self._ring)
        if self._late > self._most:
            return Trip(
                f"the loop was too late: {self._late} of the last {len(self._ring)} periods came "
                f"more than {1e3 * self._late_s:g} ms after their time or not at all",
                "another program takes the processor, and the system does not let this one "
                "go first.",
                "heli3dof doctor, and what it says of scheduling",
            )
        return None


class Lost:
    """Lost in a row: samples by the gap they leave, commands by the echo that stays behind."""

    def __init__(self, profile: Profile) -> None:
        self._dt = profile.dt
        self._most = profile.limits.lost_max_s / profile.dt
        self._echo = 0
        self._unheard = 0

    def __call__(self, now: Period) -> str | None:
        # What the host itself was too late for is no loss of the line's.
        lost = now.missed - int(now.lateness / self._dt + 1e-6)
        if lost > self._most:
            gap_ms = 1e3 * (1 + lost) * self._dt
            gap = f"no sample came for {1 + lost} periods ({gap_ms:.0f} ms)"
            if now.left_out > lost / 2:
                return Trip(f"{gap}: the device itself was held up, and made none", BUSY, LOAD)
            return Trip(f"{gap}: the line loses frames", LOSES, LOOK)
        echo = now.sample.sequence
        if echo == now.command_sequence or echo != self._echo:
            self._unheard = 0
        else:
            self._unheard += 1
        self._echo = echo
        if self._unheard > self._most:
            return Trip(
                f"the device heard none of the last {self._unheard} commands "
                f"({1e3 * self._unheard * self._dt:.0f} ms): the line loses frames",
                LOSES,
                LOOK,
            )
        return None
