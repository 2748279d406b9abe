"""What a rig owes when something is wrong: stops, silence, volts that are none, a closed door."""

from __future__ import annotations

import math
import time
import unittest
from functools import partial

from heli3dof.rig.interface import Flags

from .bench import Bench, Host, cases, owed, owed_error, owed_rest, owed_volts

SILENT_S = 0.5
"""s beyond the watchdog's time: its ramp, and a busy machine"""

AWAY = 10
"""Periods for which a host is away that is no longer than any watchdog"""
ABSENCES = 5
"""A machine that stands still itself may spoil one; who flies bursts does so every time."""


def an_emergency_stop_is_zero_volts_until_armed_however_often_it_is_called(bench: Bench) -> None:
    host = bench.open_to_move()
    host.arm()
    host.send(5.0, 5.0)
    host.rig.estop("test")
    host.rig.estop("test, again")
    for _ in range(3):
        sample = host.send(5.0, 5.0)
        owed_rest(sample, "after an emergency stop")
        owed(sample.flags & Flags.ESTOP, "ESTOP after an emergency stop", sample.flags)
    _owed_flight(host)


def an_emergency_stop_is_heard_before_arming_too(bench: Bench) -> None:
    host = bench.open_to_move()
    host.rig.estop("test")
    host.arm()
    sample = host.hold(2.0, 2.0)
    owed(sample.flags == Flags.ENABLED, "a rig that arming enables", sample.flags)


def a_voltage_that_is_not_a_number_never_reaches_the_motors(bench: Bench) -> None:
    for wrong in (math.nan, math.inf):
        host = bench.open_to_move()
        host.arm()
        host.send(5.0, 5.0)
        owed_error(partial(host.send, wrong, 5.0), f"for {wrong} V")
        sample = host.send(5.0, 5.0)
        owed(sample.v_applied == (0.0, 0.0), f"zero volts after {wrong} V", sample.v_applied)
        host.rig.close()


def closing_is_idempotent_and_final(bench: Bench) -> None:
    host = bench.open_to_move()
    host.arm()
    host.rig.close()
    host.rig.close()
    host.rig.estop("after closing")
    owed_error(lambda: host.send(1.0, 1.0), "for an exchange after closing")
    owed_error(host.rig.arm, "for arming after closing")
    owed_error(host.rig.read, "for reading after closing")


def a_silent_host_is_latched_out_until_it_arms_again(bench: Bench) -> None:
    host = bench.open_to_move()
    identity = host.rig.identity
    if identity.timebase == "virtual":
        raise unittest.SkipTest("a virtual clock stands still while the host is silent")
    host.arm()
    host.send(5.0, 5.0)
    time.sleep(identity.watchdog_s + SILENT_S)
    host.send(5.0, 5.0)
    sample = host.send(5.0, 5.0)
    owed_rest(sample, "after the host was silent")
    owed(sample.flags & Flags.LATCHED, "LATCHED after the host was silent", sample.flags)
    _owed_flight(host)


def a_host_that_was_away_flies_no_burst(bench: Bench) -> None:
    host = bench.open_to_move()
    if host.rig.identity.timebase == "virtual":
        raise unittest.SkipTest("a virtual clock stands still while the host is away")
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
    owed(stepped > AWAY - 1, f"{AWAY} periods stepped over", f"{stepped:.1f} periods")
    owed(took > AWAY - 2, f"{AWAY} periods for {AWAY} exchanges after that", f"{took:.1f} periods")


def arming_while_armed_starts_again_at_zero_volts(bench: Bench) -> None:
    host = bench.open_to_move()
    host.arm()
    host.send(5.0, 5.0)
    sample = host.arm()
    owed(sample.v_applied == (0.0, 0.0), "zero volts after arming again", sample.v_applied)
    _owed_flight(host)


def _owed_flight(host: Host) -> None:
    """Armed again, it flies."""
    flags = host.arm().flags
    owed(flags == Flags.ENABLED, "ENABLED and no other flag after arming again", flags)
    owed_volts(host.hold(5.0, 5.0), 5.0, 5.0, "after arming again")


CASES = cases(
    an_emergency_stop_is_zero_volts_until_armed_however_often_it_is_called,
    an_emergency_stop_is_heard_before_arming_too,
    a_voltage_that_is_not_a_number_never_reaches_the_motors,
    closing_is_idempotent_and_final,
    a_silent_host_is_latched_out_until_it_arms_again,
    a_host_that_was_away_flies_no_burst,
    arming_while_armed_starts_again_at_zero_volts,
)
