"""The emulated amplifier of docs/reference/protocol.md. Its output v(t) in each state:

    ARMED    v(t) = v, the last command after clipping to ± v_max (0 before the first command)
    LATCHED  v(t) = v·(1 − (t − t_expired)/ramp) for t < t_expired + ramp, then 0
             t_expired = arrival of the last command (or the ARM) + watchdog
    IDLE, STOPPED  v(t) = 0

After the time ``watchdog`` without a command, ARMED becomes LATCHED; the voltage then falls to zero
in the time ``ramp``. ARM and DISARM are requests of the host. DISARM changes ARMED to IDLE, and
no other state; a stop or a fault gives STOPPED. An ARM must carry the current ticket, a number that
changes with every ARM, DISARM, stop and expiry of the watchdog. All voltages are whole microvolts,
rounded towards zero, except in `Amplifier.mean_V` (V); all times are whole microseconds.
"""

from __future__ import annotations

from ..link.frames import Cause, Code

ENABLED, FAULT, STALL, LATCHED, STOPPED, SATURATED = 1, 2, 4, 8, 16, 32
RAMP_US = 200_000


class Amplifier:
    """State machine and output voltages of the emulated amplifier; see the module's equations.

    ``now_us`` in its methods is the time on the device's clock, in µs.
    """

    def __init__(self, v_max_uV: int, watchdog_us: int) -> None:
        self.v_max_uV = v_max_uV
        self.own_watchdog_us = watchdog_us
        self.ticket = 1
        self.last = 0
        """Number of the last accepted command, or of the ARM"""
        self.expiries = 0
        self.cause = 0
        self.faulty = False
        """True while a fault prevents arming"""
        self._state = 0
        self._saturated = False
        self._uV = (0, 0)
        """The last command (front, back), clipped"""
        self._watchdog_us = watchdog_us
        self._fed_us = 0
        self._impulse = [0, 0]
        """Integral of the output in µV·µs since the last call of `mean_V`"""
        self._summed_us = self._mean_from_us = 0

    @property
    def flags(self) -> int:
        return self._state | (SATURATED if self._saturated else 0)

    @property
    def enabled(self) -> bool:
        return self._state == ENABLED

    def arm_code(self, ticket: int) -> Code:
        """Return the result code of an ARM request: OK, or why it is refused.

        ``ticket``: the number in the request. It must equal the amplifier's present ticket, which
        the host gets in the reply to its last request. The ticket changes with every ARM, DISARM,
        stop and expiry of the watchdog. So the amplifier refuses a request from before a stop.
        """
        if self.enabled:
            return Code.ALREADY_ARMED
        if ticket != self.ticket:
            return Code.STALE_TICKET
        return Code.FAULT if self.faulty else Code.OK

    def arm(self, now_us: int, number: int, watchdog_us: int) -> None:
        """Enable the output at zero volts, and restart the average that `mean_V` returns.

        ``number``: the ARM frame's number; ``watchdog_us``: µs without a command until the output
        ramps to zero; ``now_us``: time on the device's clock, µs.
        """
        self._enter(now_us, ENABLED, Cause.NONE)
        self.last = number
        self._watchdog_us = watchdog_us
        self._fed_us = now_us
        self._impulse = [0, 0]
        self._mean_from_us = now_us

    def disarm(self, now_us: int) -> None:
        """Set zero volts at ``now_us`` (µs). The state ARMED becomes IDLE; other states remain."""
        self._enter(now_us, 0 if self.enabled else self._state, self.cause)

    def stop(self, now_us: int, cause: int, flag: int = STOPPED) -> None:
        """Set zero volts at ``now_us`` (µs).

        The next samples report the stop's ``cause`` and the state ``flag``, e.g. STOPPED or FAULT.
        """
        self._enter(now_us, flag, cause)

    def command(self, now_us: int, number: int, front_uV: int, back_uV: int) -> bool:
        """Apply voltages in µV, clipped to ± ``v_max_uV``, and return True.

        Does nothing and returns False

        - in any state but ARMED,
        - if the command's ``number`` is not newer than that of the last accepted command.
        """
        if not self.enabled or not 0 < (number - self.last) & 0xFFFFFFFF < 0x80000000:
            return False
        self._sum(now_us)
        limit = self.v_max_uV
        front, back = max(-limit, min(limit, front_uV)), max(-limit, min(limit, back_uV))
        self._saturated = (front, back) != (front_uV, back_uV)
        self._uV = (front, back)
        self.last = number
        self._fed_us = now_us
        return True

    def advance(self, now_us: int) -> None:
        """Change the state from ARMED to LATCHED if the watchdog has expired by ``now_us`` (µs)."""
        if self.enabled and now_us > self._fed_us + self._watchdog_us:
            self._sum(self._expired_us)
            self._state, self._saturated = LATCHED, False
            self.cause = Cause.WATCHDOG
            self.expiries += 1
            self._new_ticket()

    def output_uV(self, now_us: int) -> tuple[int, int]:
        """Return the output (front, back) in µV at ``now_us`` (µs).

        ``now_us`` must not decrease from call to call.
        """
        self.advance(now_us)
        if self._state == ENABLED:
            return self._uV
        if self._state == LATCHED:
            left = RAMP_US - (now_us - self._expired_us)
            front, back = self._uV
            return _part(front, left, RAMP_US), _part(back, left, RAMP_US)
        return (0, 0)

    def mean_V(self, now_us: int) -> tuple[float, float]:
        """Return the mean output (front, back) in V up to ``now_us`` (µs).

        The average starts at the previous call of this method or at the last arming, whichever is
        later.
        """
        self._sum(now_us)
        span = max(1, now_us - self._mean_from_us)
        front, back = self._impulse
        self._impulse = [0, 0]
        self._mean_from_us = now_us
        return front / span / 1e6, back / span / 1e6

    @property
    def _expired_us(self) -> int:
        return self._fed_us + self._watchdog_us

    def _enter(self, now_us: int, state: int, cause: int) -> None:
        self._sum(now_us)
        self._state, self._saturated, self._uV = state, False, (0, 0)
        self.cause = cause
        self._new_ticket()

    def _new_ticket(self) -> None:
        self.ticket = (self.ticket + 1) & 0xFFFFFFFF

    def _sum(self, now_us: int) -> None:
        self.advance(now_us)
        start = self._summed_us
        if now_us <= start:
            return
        if self._state == LATCHED:
            end = min(now_us, self._expired_us + RAMP_US)
            if end > start:
                front, back = self.output_uV((start + end) // 2)
                self._impulse[0] += front * (end - start)
                self._impulse[1] += back * (end - start)
        else:
            self._impulse[0] += self._uV[0] * (now_us - start)
            self._impulse[1] += self._uV[1] * (now_us - start)
        self._summed_us = now_us


def _part(uV: int, left: int, whole: int) -> int:
    if left <= 0:
        return 0
    part = abs(uV) * left // whole
    return part if uV >= 0 else -part
