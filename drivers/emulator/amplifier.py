"""The emulated amplifier of protocol.md: states, ticket, watchdog, and volts at any instant.

    ARMED    v(t) = last command, clipped to ± v_max
    LATCHED  v(t) = v·(1 − (t − t_expired)/ramp), cut towards zero to a whole microvolt
             t_expired = the last command's arrival (or the ARM's) + watchdog
    IDLE, STOPPED  v(t) = 0

Whole microvolts and microseconds throughout.
"""

from __future__ import annotations

from ..link.frames import Cause, Code

ENABLED, FAULT, STALL, LATCHED, STOPPED, SATURATED = 1, 2, 4, 8, 16, 32
RAMP_US = 200_000


class Amplifier:
    """What decides whether volts reach the motors."""

    def __init__(self, v_max_uV: int, watchdog_us: int, ramp_us: int = RAMP_US) -> None:
        self.v_max_uV = v_max_uV
        self.own_watchdog_us = watchdog_us
        self.ramp_us = ramp_us
        self.ticket = 1
        self.last = 0
        """Number of the last command accepted, or of the ARM"""
        self.expiries = 0
        self.cause = 0
        self.faulty = False
        """True while it reports a fault that arming cannot clear"""
        self._state = 0
        self._saturated = False
        self._uV = (0, 0)
        """what was asked for, clipped"""
        self._watchdog_us = watchdog_us
        self._fed_us = 0
        self._impulse = [0, 0]
        """µV·µs since the mean was last taken"""
        self._summed_us = self._mean_from_us = 0

    @property
    def flags(self) -> int:
        return self._state | (SATURATED if self._saturated else 0)

    @property
    def enabled(self) -> bool:
        return self._state == ENABLED

    def arm_code(self, ticket: int) -> Code:
        """What an ARM with this ticket would be told, as far as it is the amplifier's to say."""
        if self.enabled:
            return Code.ALREADY_ARMED
        if ticket != self.ticket:
            return Code.STALE_TICKET
        return Code.FAULT if self.faulty else Code.OK

    def arm(self, now_us: int, number: int, watchdog_us: int) -> None:
        """Enable at zero volts; the plant's next mean begins here."""
        self._enter(now_us, ENABLED, Cause.NONE)
        self.last = number
        self._watchdog_us = watchdog_us
        self._fed_us = now_us
        self._impulse = [0, 0]
        self._mean_from_us = now_us

    def disarm(self, now_us: int) -> None:
        """Zero volts; latches and stops stay."""
        self._enter(now_us, 0 if self.enabled else self._state, self.cause)

    def stop(self, now_us: int, cause: int, flag: int = STOPPED) -> None:
        """Zero volts at once, from every state."""
        self._enter(now_us, flag, cause)

    def command(self, now_us: int, number: int, front_uV: int, back_uV: int) -> bool:
        """Take a command, if it is newer than the last and volts may flow."""
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
        """Let the watchdog see the time."""
        if self.enabled and now_us > self._fed_us + self._watchdog_us:
            self._sum(self._expired_us)
            self._state, self._saturated = LATCHED, False
            self.cause = Cause.WATCHDOG
            self.expiries += 1
            self._renew()

    def output_uV(self, now_us: int) -> tuple[int, int]:
        """What is put out at an instant that is not in the past."""
        self.advance(now_us)
        if self._state == ENABLED:
            return self._uV
        if self._state == LATCHED:
            left = self.ramp_us - (now_us - self._expired_us)
            front, back = self._uV
            return _part(front, left, self.ramp_us), _part(back, left, self.ramp_us)
        return (0, 0)

    def mean_V(self, now_us: int) -> tuple[float, float]:
        """V, the mean from the last call (or the arming) until now."""
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
        self._renew()

    def _renew(self) -> None:
        self.ticket = (self.ticket + 1) & 0xFFFFFFFF

    def _sum(self, now_us: int) -> None:
        """Add up the output until now; on the ramp with its value half-way."""
        self.advance(now_us)
        start = self._summed_us
        if now_us <= start:
            return
        if self._state == LATCHED:
            end = min(now_us, self._expired_us + self.ramp_us)
            if end > start:
                front, back = self.output_uV((start + end) // 2)
                self._impulse[0] += front * (end - start)
                self._impulse[1] += back * (end - start)
        else:
            self._impulse[0] += self._uV[0] * (now_us - start)
            self._impulse[1] += self._uV[1] * (now_us - start)
        self._summed_us = now_us


def _part(uV: int, left: int, whole: int) -> int:
    """uV·left/whole, cut towards zero; zero where nothing is left."""
    if left <= 0:
        return 0
    part = abs(uV) * left // whole
    return part if uV >= 0 else -part
