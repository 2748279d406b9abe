"""Test cases for a rig's reaction to a stop, missing commands, invalid voltages and closing."""

from __future__ import annotations

import math
import time
import unittest
from functools import partial

from heli3dof.rig.interface import Flags

from .bench import (
    Bench,
    Host,
    cases,
    require,
    require_error,
    require_rest,
    require_volts,
    require_zero_volts,
)

SILENT_S = 0.5
"""s of silence beyond the watchdog's time, for its ramp to zero and a busy computer"""

AWAY = 10
"""Periods without a command, shorter than any watchdog's time"""
ABSENCES = 5
"""Attempts: a host stall may make one fail, a faulty driver all"""


def an_emergency_stop_holds_until_arming_and_may_be_repeated(bench: Bench) -> None:
    host = bench.open_to_move()
    host.arm()
    host.send(5.0, 5.0)
    host.rig.estop("test")
    host.rig.estop("test, again")
    for _ in range(3):
        sample = host.send(5.0, 5.0)
        require_rest(sample, "after an emergency stop")
        require(sample.flags & Flags.ESTOP, "ESTOP after an emergency stop", sample.flags)
    _require_flight(host)


def an_emergency_stop_before_arming_is_cleared_by_arming(bench: Bench) -> None:
    host = bench.open_to_move()
    host.rig.estop("test")
    host.arm()
    sample = host.hold(2.0, 2.0)
    require(sample.flags == Flags.ENABLED, "a rig enabled by arming", sample.flags)


def a_voltage_that_is_not_finite_never_reaches_the_motors(bench: Bench) -> None:
    for wrong in (math.nan, math.inf):
        host = bench.open_to_move()
        host.arm()
        host.send(5.0, 5.0)
        require_error(partial(host.send, wrong, 5.0), f"for {wrong} V")
        sample = host.send(5.0, 5.0)
        require_zero_volts(sample, f"after {wrong} V")
        host.rig.close()


def closing_is_idempotent_and_final(bench: Bench) -> None:
    host = bench.open_to_move()
    host.arm()
    host.rig.close()
    host.rig.close()
    host.rig.estop("after closing")
    require_error(lambda: host.send(1.0, 1.0), "for an exchange after closing")
    require_error(host.rig.arm, "for arming after closing")
    require_error(host.rig.read, "for reading after closing")


def the_watchdog_latches_a_silent_host_until_it_arms(bench: Bench) -> None:
    host = bench.open_to_move()
    identity = host.rig.identity
    if identity.timebase == "virtual":
        raise unittest.SkipTest("a virtual clock does not advance while the host is silent")
    host.arm()
    host.send(5.0, 5.0)
    time.sleep(identity.watchdog_s + SILENT_S)
    host.send(5.0, 5.0)
    sample = host.send(5.0, 5.0)
    require_rest(sample, "after the host was silent")
    require(sample.flags & Flags.LATCHED, "LATCHED after the host was silent", sample.flags)
    _require_flight(host)


def skipped_periods_are_not_executed_in_a_burst(bench: Bench) -> None:
    host = bench.open_to_move()
    if host.rig.identity.timebase == "virtual":
        raise unittest.SkipTest("a virtual clock does not advance while the host is away")
    dt = bench.profile.dt
    host.arm()
    for _ in range(ABSENCES):
        before = host.send(2.0, 2.0)
        time.sleep(AWAY * dt)
        after = host.send(2.0, 2.0)
        stepped = (after.device_time_s - before.device_time_s) / dt
        start = time.monotonic()
        for _ in range(AWAY):
            host.send(2.0, 2.0)
        took = (time.monotonic() - start) / dt
        if stepped > AWAY - 1 and took > AWAY - 2:
            break
    require(stepped > AWAY - 1, f"{AWAY} periods skipped", f"{stepped:.1f} periods")
    require(
        took > AWAY - 2, f"{AWAY} periods for {AWAY} exchanges after that", f"{took:.1f} periods"
    )


def arming_while_armed_restarts_at_zero_volts(bench: Bench) -> None:
    host = bench.open_to_move()
    host.arm()
    host.send(5.0, 5.0)
    sample = host.arm()
    require_zero_volts(sample, "after arming again")
    _require_flight(host)


def _require_flight(host: Host) -> None:
    """Arm the rig; raise NotConforming unless it then applies the voltages sent."""
    flags = host.arm().flags
    require(flags == Flags.ENABLED, "ENABLED and no other flag after arming again", flags)
    require_volts(host.hold(5.0, 5.0), 5.0, 5.0, "after arming again")


CASES = cases(
    an_emergency_stop_holds_until_arming_and_may_be_repeated,
    an_emergency_stop_before_arming_is_cleared_by_arming,
    a_voltage_that_is_not_finite_never_reaches_the_motors,
    closing_is_idempotent_and_final,
    the_watchdog_latches_a_silent_host_until_it_arms,
    skipped_periods_are_not_executed_in_a_burst,
    arming_while_armed_restarts_at_zero_volts,
)
