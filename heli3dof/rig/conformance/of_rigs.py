"""What an open rig owes: who it is, its clock, its samples, the volts that were asked for."""

from __future__ import annotations

import math
import time
import unittest
from dataclasses import is_dataclass
from itertools import pairwise

from heli3dof.errors import DeviceError
from heli3dof.rig.interface import Flags, Sample
from heli3dof.rig.link_counters import attribute_of

from .bench import Bench, Case, Host, cases, owed, owed_rest, owed_volts

ECHOES = 40
"""Commands that are sent one after another"""
STEPS = 50
"""Periods in which the clock is looked at"""
ROUNDS = 20
"""On a busy machine, until one is as it should be; a driver that errs does so in every one"""
STEP, HOST_STEP = 0.05, 0.25
"""Of a period: how far the quarter of steps that come nearest may be from whole ones"""
ENDS = 15
"""Samples at either end of a measurement"""
BUSY_S = 0.03
"""s by which a busy machine may be late at both ends of a measurement"""


def the_identity_is_complete_and_fits_the_profile(bench: Bench) -> None:
    identity = bench.open().rig.identity
    for name in ("driver", "model", "serial", "firmware", "protocol"):
        owed(getattr(identity, name), f"a {name} in the identity", identity)
    e = bench.profile.encoder
    owed(identity.counts_per_rev == (e.roll, e.pitch, e.yaw), "the profile's counts", identity)
    owed(identity.v_max == bench.profile.motor.v_max, "the profile's v_max", identity.v_max)
    least = 2 * bench.profile.dt
    owed(least <= identity.watchdog_s <= 1.0, f"a watchdog of {least:g} to 1 s", identity)
    owed(identity.timebase in ("host", "device", "virtual"), "a known timebase", identity)
    owed(identity.boot is None or isinstance(identity.boot, int), "a boot, or None", identity)


def what_a_rig_counts_are_numbers_that_recordings_can_keep(bench: Bench) -> None:
    rig = bench.open().rig
    statistics = getattr(rig, "statistics", None)
    if statistics is None:
        raise unittest.SkipTest("this rig counts nothing")
    owed(is_dataclass(statistics), "statistics that are a dataclass", statistics)
    for name in ("lost", "device_skipped"):
        count = getattr(statistics, attribute_of(statistics, name) or "", 0)
        owed(isinstance(count, int) and count >= 0, f"a count of samples {name}", count)


def before_arming_no_volt_gets_out(bench: Bench) -> None:
    host = bench.open()
    try:
        sample = host.send(5.0, 5.0)
    except DeviceError:
        return
    owed_rest(sample, "before arming")


def reading_shows_a_rig_that_is_not_armed_and_leaves_it_so(bench: Bench) -> None:
    rig = bench.open().rig
    samples = [rig.read() for _ in range(5)]
    for sample in samples:
        owed_rest(sample, "when a rig is read that is not armed")
        _owed_sample(sample)
    times = [s.device_time_s for s in samples]
    owed(all(b >= a for a, b in pairwise(times)), "device time that never goes back", times)


def reading_after_a_flight_shows_where_the_rig_is(bench: Bench) -> None:
    host = bench.open_to_move()
    host.arm()
    for _ in range(5):
        flown = host.send(3.0, 3.0)
    host.rig.estop("test")
    sample = host.rig.read()
    owed_rest(sample, "when a rig is read that was stopped")
    owed(sample.flags & Flags.ESTOP, "ESTOP when a rig is read that was stopped", sample.flags)
    owed(
        sample.device_time_s >= flown.device_time_s,
        "device time that never goes back",
        (flown.device_time_s, sample.device_time_s),
    )


def arming_enables_at_zero_volts(bench: Bench) -> None:
    host = bench.open_to_move()
    before = time.monotonic()
    sample = host.arm()
    owed(sample.flags == Flags.ENABLED, "ENABLED and no other flag after arming", sample.flags)
    owed(sample.v_applied == (0.0, 0.0), "zero volts after arming", sample.v_applied)
    owed(before <= sample.host_time_s <= time.monotonic(), "the host's monotonic time", sample)
    _owed_sample(sample)


def a_sample_echoes_the_commands_sequence_and_its_volts(bench: Bench) -> None:
    host = bench.open_to_move()
    host.arm()
    sent: dict[int, tuple[float, float]] = {0: (0.0, 0.0)}
    best = 0
    for _ in range(ROUNDS):
        # On a busy machine's line some come late.
        best = max(best, _echoed_at_once(host, sent))
        if best >= ECHOES / 2:
            return
    owed(False, f"half of {ECHOES} commands echoed at once", f"{best}, at best")


def _echoed_at_once(host: Host, sent: dict[int, tuple[float, float]]) -> int:
    """Of `ECHOES` commands, so many; ``sent``: every command's volts, by its sequence."""
    at_once = 0
    for k in range(ECHOES):
        volts = (3.0 + 0.1 * k, -2.0)
        sent[host.sequence + 1] = volts
        sample = host.send(*volts)
        owed(sample.sequence in sent, "the sequence of a command that was sent", sample.sequence)
        owed_volts(sample, *sent[sample.sequence], "in the period of the command that is echoed")
        owed(sample.flags == Flags.ENABLED, "ENABLED and no other flag", sample.flags)
        at_once += sample.sequence == host.sequence
    return at_once


def the_devices_clock_advances_by_the_control_period(bench: Bench) -> None:
    host, dt = bench.open_to_move(), bench.profile.dt
    timebase = host.rig.identity.timebase
    armed = host.arm().device_time_s
    first = last = host.send(0.0, 0.0)
    owed(first.device_time_s > armed, "device time that advances", (armed, first.device_time_s))
    # Where the host keeps the time, its own lateness on a busy computer is in every step.
    within = (HOST_STEP if timebase == "host" else STEP) * dt
    usual = math.inf
    ahead = [first.host_time_s - first.device_time_s]
    for _ in range(ROUNDS):
        away = []
        for _ in range(STEPS):
            due, before = host.due, last.device_time_s
            last = host.send(0.0, 0.0)
            step = last.device_time_s - before
            owed(step > 0, "device time that advances", f"a step of {step:g} s")
            # A busy host skips periods, and the clock must step over as many.
            skipping = {"host": host.due - due, "device": round(step / dt) * dt, "virtual": dt}
            away.append(abs(step - max(dt, skipping[timebase])))
            ahead.append(last.host_time_s - last.device_time_s)
        usual = min(usual, sorted(away)[STEPS // 4])
        if usual <= within:
            break
    owed(usual <= within, f"steps of whole periods of {dt:g} s", f"{usual:g} s away from it")
    if timebase != "virtual":
        # Of some at either end the one that came soonest: any other was held up on its way.
        here = last.host_time_s - first.host_time_s
        gains = min(ahead[-ENDS:]) - min(ahead[:ENDS])
        same = abs(gains) <= 0.05 * here + BUSY_S
        owed(same, f"a clock that goes as ours: {here:.3f} s", f"{here - gains:.3f} s")


def volts_stay_within_the_limit_and_the_sample_owns_up_to_it(bench: Bench) -> None:
    host = bench.open_to_move()
    limit = bench.profile.motor.v_max
    host.arm()
    sample = host.hold(10 * limit, -10 * limit)
    owed_volts(sample, limit, -limit, "where more was asked for")
    owed(sample.flags & Flags.SATURATED, "SATURATED where more was asked for", sample.flags)
    after = host.hold(1.0, 1.0)
    owed(not after.flags & Flags.SATURATED, "SATURATED gone when less is asked for", after.flags)


def currents_are_numbers_of_the_voltages_sign_or_nan(bench: Bench) -> None:
    host = bench.open_to_move()
    host.arm()
    for _ in range(5):
        sample = host.hold(6.0, -6.0)
    for ampere, sign in zip(sample.current, (1, -1), strict=True):
        owed(
            math.isnan(ampere) or ampere * sign > 0,
            "currents of the voltages' signs, or NaN",
            sample.current,
        )


def equal_volts_lift_the_body_and_more_in_front_raises_the_front(bench: Bench) -> None:
    host = bench.open_to_move()
    e = bench.profile.encoder
    roll, pitch, yaw = (math.copysign(1, c) for c in (e.roll, e.pitch, e.yaw))
    start = host.arm().counts
    for _ in range(150):
        sample = host.send(12.0, 11.5)
    owed((sample.counts[0] - start[0]) * roll > 0, "a body lifted by 12 V", sample.counts)
    owed((sample.counts[1] - start[1]) * pitch > 0, "a front raised by more volts", sample.counts)
    for _ in range(150):
        sample = host.send(11.5, 12.0)
    owed((sample.counts[2] - start[2]) * yaw < 0, "clockwise, the front up", sample.counts)


def _owed_sample(sample: Sample) -> None:
    owed(all(isinstance(c, int) for c in sample.counts), "whole counts", sample.counts)
    owed(len(sample.counts) == 3, "roll, pitch and yaw", sample.counts)
    owed(isinstance(sample.flags, Flags), "Flags", type(sample.flags))
    owed(math.isfinite(sample.device_time_s), "a device time", sample.device_time_s)


CASES = (
    *cases(
        the_identity_is_complete_and_fits_the_profile,
        what_a_rig_counts_are_numbers_that_recordings_can_keep,
        before_arming_no_volt_gets_out,
        reading_shows_a_rig_that_is_not_armed_and_leaves_it_so,
        reading_after_a_flight_shows_where_the_rig_is,
        arming_enables_at_zero_volts,
        a_sample_echoes_the_commands_sequence_and_its_volts,
        the_devices_clock_advances_by_the_control_period,
        volts_stay_within_the_limit_and_the_sample_owns_up_to_it,
        currents_are_numbers_of_the_voltages_sign_or_nan,
    ),
    Case(
        equal_volts_lift_the_body_and_more_in_front_raises_the_front.__name__,
        equal_volts_lift_the_body_and_more_in_front_raises_the_front,
        at_rest=True,
    ),
)
