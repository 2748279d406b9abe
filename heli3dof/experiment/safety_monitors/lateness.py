"""A loop that is too late to fly, and a line that loses what it should carry.

**Late**: of the last second's periods, more than ``late_max_share`` came later than ``late_max_s``
after their deadline; those that such a sample was too late for count with it. A host that other
programs hold up still has some quick periods. Where even the quickest tenth of the last second's
commands took more than `SLOW_PERIODS` to be echoed, the line or the device is slow, not the host.

**Lost**: for longer than ``lost_max_s`` no sample came though the host waited for it (lost on the
line, or left out by a device that was held up), or the samples that came echoed no new command.
"""

from __future__ import annotations

from array import array

from heli3dof.experiment.control_loop.control_period import Period
from heli3dof.rig.profile import Profile
from heli3dof.rig.trip import Trip

WINDOW_S = 1.0
LOSES = "a loose or long cable, a hub in between, or the motors' leads beside it."
BUSY = "the device has more to do than it has time for, or its program was stopped."
LOAD = "heli3dof doctor, and what it says of the device; a lower rate_hz in the profile"
LOOK = "heli3dof doctor, and what it says of loss; a shorter shielded cable away from the motors"


QUICKEST = 0.1
"""Share of the last second's echoes; a host that is starved of its processor gets more than that
many periods in time, or the device's watchdog expires first"""
SLOW_PERIODS = 1.5
"""Half-way between a command that the next sample echoes (1) and one that the sample after it
does (2)"""


class Late:
    """A ring of the last second's periods: late or not."""

    def __init__(self, profile: Profile) -> None:
        limits = profile.limits
        self._late_s = limits.late_max_s
        self._ring = bytearray(max(2, round(WINDOW_S / profile.dt)))
        self._most = limits.late_max_share * len(self._ring)
        self._at = self._late = 0
        self._dt = profile.dt
        self._echo_s = array("d", bytes(8 * len(self._ring)))
        self._echoes = 0

    def __call__(self, now: Period) -> str | None:
        if now.echo_s:
            self._echo_s[self._echoes % len(self._echo_s)] = now.echo_s
            self._echoes += 1
        late = now.lateness > self._late_s
        if not late and not self._late:
            return None
        for _ in range(1 + (min(now.missed - now.left_out, len(self._ring)) if late else 0)):
            self._late += late - self._ring[self._at]
            self._ring[self._at] = late
            self._at = (self._at + 1) % len(self._ring)
        if self._late > self._most:
            what = (
                f"the loop was too late: {self._late} of the last {len(self._ring)} periods came "
                f"more than {1e3 * self._late_s:g} ms after their time or not at all"
            )
            quickest_s = self._quickest_echo_s()
            if quickest_s > SLOW_PERIODS * self._dt:
                return Trip(
                    f"{what}; every command took {1e3 * quickest_s:.1f} ms or more "
                    f"({quickest_s / self._dt:.0f} periods) to be echoed",
                    "the line or the device is slow: an adapter that collects bytes (FTDI latency "
                    "timer), a USB hub, a network link, or a device below this rate.",
                    "heli3dof doctor, and what it says of the latency timer; plug the rig in "
                    "directly; a lower loop.rate_hz in the profile",
                )
            return Trip(
                what,
                "another program takes the processor, and the system does not let this one "
                "go first.",
                "heli3dof doctor, and what it says of scheduling",
            )
        return None

    def _quickest_echo_s(self) -> float:
        """What nine tenths of the last echoes took at least; 0 where there was none."""
        kept = sorted(self._echo_s[: min(self._echoes, len(self._echo_s))])
        return kept[int(QUICKEST * len(kept))] if kept else 0.0


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
