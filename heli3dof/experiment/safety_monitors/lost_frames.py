"""Detects a link that loses samples or commands.

Each sample contains the number of the last command that the device executed. The sample *echoes*
this command. The monitor ends the flight if one of these states lasts longer than ``lost_max_s``
(s):

- The host waits, but no sample comes: the link lost a sample, or a busy device made none.
- Samples come, but echo no new command. If the device's time also stands still, the device repeats
  one sample.

An echo of a command that this flight never sent ends the flight without this delay, because then no
echo can be trusted. Until the first command arrives, the device may echo the last command of an
earlier flight.
"""

from __future__ import annotations

from heli3dof.experiment.control_loop.control_period import Period
from heli3dof.experiment.safety_monitors import SafetyMonitor
from heli3dof.experiment.safety_monitors.encoder_jump import stopped_clock
from heli3dof.rig.profile import Profile
from heli3dof.rig.trip import Trip

LINE_CAUSE = "a loose or long cable, a hub in between, or motor leads next to it."
LINE_FIX = "heli3dof doctor: see loss; a shorter shielded cable away from the motors"
DEVICE_CAUSE = "the device has more to do than it has time for, or its program was stopped."
DEVICE_FIX = "heli3dof doctor: see the device; a lower rate_hz in the profile"


class LostFrames(SafetyMonitor):
    """Safety monitor that ends the flight if the link loses samples or commands for too long.

    It limits two numbers: the number of consecutive lost samples, and the number of consecutive
    samples that acknowledge no new command. Each sample contains the number of the last command
    that the device executed. The sample acknowledges this command.
    """

    order = 30

    def __init__(self, profile: Profile) -> None:
        self._dt = profile.dt
        self._most = profile.limits.lost_max_s / profile.dt
        self._first_echo: int | None = None
        self._echo = 0
        self._unacknowledged = 0
        self._echoed_t = 0.0
        """t of the first sample with the present echo"""

    def __call__(self, now: Period) -> str | None:
        # Periods skipped because the host was late are no loss on the line.
        lost = now.skipped - int(now.lateness / self._dt + 1e-6)
        if lost > self._most:
            gap_ms = 1e3 * (1 + lost) * self._dt
            gap = f"no sample came for {1 + lost} periods ({gap_ms:.0f} ms)"
            if now.device_skipped > lost / 2:
                what = f"{gap}: the device itself was held up, and made none"
                return Trip(what, DEVICE_CAUSE, DEVICE_FIX)
            return Trip(f"{gap}: the line loses frames", LINE_CAUSE, LINE_FIX)
        echo = now.sample.sequence
        if self._first_echo is None:
            self._first_echo = echo
        if not 0 <= echo <= now.command_sequence and echo != self._first_echo:
            return Trip(
                f"the device acknowledged command {echo}, which was never sent (the last one was "
                f"{now.command_sequence})",
                "another program commands the device, or the device or its driver reads the "
                "numbers of commands wrongly.",
                "end the other program; python -m heli3dof.rig.conformance URL examines the driver",
            )
        if echo == now.command_sequence or echo != self._echo:
            self._unacknowledged = 0
            self._echoed_t = now.t
        else:
            self._unacknowledged += 1
        self._echo = echo
        if self._unacknowledged > self._most:
            if now.t == self._echoed_t:
                return stopped_clock(now.t, self._unacknowledged * self._dt)
            return Trip(
                f"the device acknowledged none of the last {self._unacknowledged} commands "
                f"({1e3 * self._unacknowledged * self._dt:.0f} ms): the line loses frames or "
                "delays them, or the device ignores commands",
                f"{LINE_CAUSE[:-1]}; a latency above this time; or a device that hangs, or whose "
                "driver does not report the executed command's number.",
                LINE_FIX,
            )
        return None
