"""Test cases for a rig with an open connection: its identity, clock, samples and voltages."""

from __future__ import annotations

import math
import time
import unittest
from dataclasses import is_dataclass
from itertools import pairwise

from heli3dof.errors import DeviceError
from heli3dof.rig.interface import Flags, HasLinkStatistics, Sample
from heli3dof.rig.link_counters import attribute_of

from .bench import (
    Bench,
    Case,
    Host,
    cases,
    require,
    require_rest,
    require_volts,
    require_zero_volts,
)

ECHOES = 40
"""commands sent one after another"""
STEPS = 50
"""periods in which the clock is observed"""
ROUNDS = 20
"""Attempts: a busy computer makes some fail, a faulty driver all"""
STEP, HOST_STEP = 0.05, 0.25
"""Bounds on the lower quartile of the clock steps' errors, in periods: `STEP` if the device or a
virtual clock keeps the time, `HOST_STEP` if the host does"""
ENDS = 15
"""Number of samples at each end of a measurement, of which the least delayed one is used"""
BUSY_S = 0.03
"""s by which a busy computer may be late at both ends of a measurement"""


def the_identity_is_complete_and_agrees_with_the_profile(bench: Bench) -> None:
    identity = bench.open().rig.identity
    for name in ("driver", "model", "serial", "firmware", "protocol"):
        require(getattr(identity, name), f"a {name} in the identity", identity)
    e = bench.profile.encoder
    require(identity.counts_per_rev == (e.roll, e.pitch, e.yaw), "the profile's counts", identity)
    require(identity.v_max == bench.profile.motor.v_max, "the profile's v_max", identity.v_max)
    least = 2 * bench.profile.dt
    require(least <= identity.watchdog_s <= 1.0, f"a watchdog of {least:g} to 1 s", identity)
    require(identity.timebase in ("host", "device", "virtual"), "a known timebase", identity)
    require(identity.boot is None or isinstance(identity.boot, int), "a boot, or None", identity)


def link_statistics_are_a_dataclass_of_counts(bench: Bench) -> None:
    rig = bench.open().rig
    statistics = rig.statistics if isinstance(rig, HasLinkStatistics) else None
    if statistics is None:
        raise unittest.SkipTest("this rig has no link statistics")
    require(is_dataclass(statistics), "statistics that are a dataclass", statistics)
    for name in ("lost", "device_skipped"):
        count = getattr(statistics, attribute_of(statistics, name) or "", 0)
        require(isinstance(count, int) and count >= 0, f"a count of samples {name}", count)


def the_output_is_zero_before_arming(bench: Bench) -> None:
    host = bench.open()
    try:
        sample = host.send(5.0, 5.0)
    except DeviceError:
        return
    require_rest(sample, "before arming")


def reading_does_not_arm(bench: Bench) -> None:
    rig = bench.open().rig
    samples = [rig.read() for _ in range(5)]
    for sample in samples:
        require_rest(sample, "when an unarmed rig is read")
        _require_sample(sample)
    times = [s.device_time_s for s in samples]
    require(all(b >= a for a, b in pairwise(times)), "device time that never goes back", times)


def reading_after_a_stop_returns_the_present_state(bench: Bench) -> None:
    host = bench.open_to_move()
    host.arm()
    for _ in range(5):
        flown = host.send(3.0, 3.0)
    host.rig.estop("test")
    sample = host.rig.read()
    require_rest(sample, "when a stopped rig is read")
    require(sample.flags & Flags.ESTOP, "ESTOP when a stopped rig is read", sample.flags)
    require(
        sample.device_time_s >= flown.device_time_s,
        "device time that never goes back",
        (flown.device_time_s, sample.device_time_s),
    )


def arming_enables_at_zero_volts(bench: Bench) -> None:
    host = bench.open_to_move()
    before = time.monotonic()
    sample = host.arm()
    require(sample.flags == Flags.ENABLED, "ENABLED and no other flag after arming", sample.flags)
    require_zero_volts(sample, "after arming")
    require(before <= sample.host_time_s <= time.monotonic(), "the host's monotonic time", sample)
    _require_sample(sample)


def a_sample_echoes_the_commands_sequence_and_voltages(bench: Bench) -> None:
    host = bench.open_to_move()
    host.arm()
    sent: dict[int, tuple[float, float]] = {0: (0.0, 0.0)}
    best = 0
    for _ in range(ROUNDS):
        best = max(best, _echoed_at_once(host, sent))
        if best >= ECHOES / 2:
            return
    require(False, f"half of {ECHOES} commands echoed in the next sample", f"{best}, at best")


def _echoed_at_once(host: Host, sent: dict[int, tuple[float, float]]) -> int:
    """Send `ECHOES` commands, one per period; return how many of them were echoed at once.

    A sample echoes a command by its sequence number. A command is echoed at once if the first
    sample after the command echoes it. ``sent``: sequence number → voltages (V) of the commands
    sent so far; the function adds its own commands. Raises NotConforming if a sample is wrong.
    """
    at_once = 0
    for k in range(ECHOES):
        volts = (3.0 + 0.1 * k, -2.0)
        sent[host.sequence + 1] = volts
        sample = host.send(*volts)
        require(sample.sequence in sent, "the sequence of a command that was sent", sample.sequence)
        require_volts(sample, *sent[sample.sequence], "in the period of the echoed command")
        require(sample.flags == Flags.ENABLED, "ENABLED and no other flag", sample.flags)
        at_once += sample.sequence == host.sequence
    return at_once


def the_devices_clock_advances_by_the_control_period(bench: Bench) -> None:
    host, dt = bench.open_to_move(), bench.profile.dt
    timebase = host.rig.identity.timebase
    armed = host.arm().device_time_s
    first = last = host.send(0.0, 0.0)
    require(first.device_time_s > armed, "device time that advances", (armed, first.device_time_s))
    # A host that keeps time adds its own lateness to every step.
    within = (HOST_STEP if timebase == "host" else STEP) * dt
    usual = math.inf
    ahead = [first.host_time_s - first.device_time_s]
    for _ in range(ROUNDS):
        away = []
        for _ in range(STEPS):
            due, before = host.due, last.device_time_s
            last = host.send(0.0, 0.0)
            step = last.device_time_s - before
            require(step > 0, "device time that advances", f"a step of {step:g} s")
            # A busy host skips periods, and the clock must advance by as many.
            skipping = {"host": host.due - due, "device": round(step / dt) * dt, "virtual": dt}
            away.append(abs(step - max(dt, skipping[timebase])))
            ahead.append(last.host_time_s - last.device_time_s)
        usual = min(usual, sorted(away)[STEPS // 4])
        if usual <= within:
            break
    require(usual <= within, f"steps of whole periods of {dt:g} s", f"{usual:g} s away from it")
    if timebase != "virtual":
        # The sample with the least delay at either end.
        here = last.host_time_s - first.host_time_s
        gains = min(ahead[-ENDS:]) - min(ahead[:ENDS])
        same = abs(gains) <= 0.05 * here + BUSY_S
        require(same, f"a clock with the host's rate: {here:.3f} s", f"{here - gains:.3f} s")


def voltages_are_clipped_and_the_sample_is_flagged_saturated(bench: Bench) -> None:
    host = bench.open_to_move()
    limit = bench.profile.motor.v_max
    host.arm()
    sample = host.hold(10 * limit, -10 * limit)
    require_volts(sample, limit, -limit, "beyond the limit")
    require(sample.flags & Flags.SATURATED, "SATURATED beyond the limit", sample.flags)
    after = host.hold(1.0, 1.0)
    require(not after.flags & Flags.SATURATED, "SATURATED cleared below the limit", after.flags)


def currents_have_the_voltages_signs_or_are_nan(bench: Bench) -> None:
    host = bench.open_to_move()
    host.arm()
    for _ in range(5):
        sample = host.hold(6.0, -6.0)
    for ampere, sign in zip(sample.current, (1, -1), strict=True):
        require(
            math.isnan(ampere) or ampere * sign > 0,
            "currents of the voltages' signs, or NaN",
            sample.current,
        )


def equal_voltages_lift_the_body_and_a_larger_front_voltage_raises_the_front(bench: Bench) -> None:
    host = bench.open_to_move()
    e = bench.profile.encoder
    roll, pitch, yaw = (math.copysign(1, c) for c in (e.roll, e.pitch, e.yaw))
    start = host.arm().counts
    for _ in range(150):
        sample = host.send(12.0, 11.5)
    require((sample.counts[0] - start[0]) * roll > 0, "a body lifted by 12 V", sample.counts)
    require(
        (sample.counts[1] - start[1]) * pitch > 0,
        "a front raised by a larger voltage",
        sample.counts,
    )
    for _ in range(150):
        sample = host.send(11.5, 12.0)
    require((sample.counts[2] - start[2]) * yaw < 0, "clockwise, the front up", sample.counts)


def _require_sample(sample: Sample) -> None:
    require(all(isinstance(c, int) for c in sample.counts), "whole counts", sample.counts)
    require(len(sample.counts) == 3, "roll, pitch and yaw", sample.counts)
    require(isinstance(sample.flags, Flags), "Flags", type(sample.flags))
    require(math.isfinite(sample.device_time_s), "a device time", sample.device_time_s)


CASES = (
    *cases(
        the_identity_is_complete_and_agrees_with_the_profile,
        link_statistics_are_a_dataclass_of_counts,
        the_output_is_zero_before_arming,
        reading_does_not_arm,
        reading_after_a_stop_returns_the_present_state,
        arming_enables_at_zero_volts,
        a_sample_echoes_the_commands_sequence_and_voltages,
        the_devices_clock_advances_by_the_control_period,
        voltages_are_clipped_and_the_sample_is_flagged_saturated,
        currents_have_the_voltages_signs_or_are_nan,
    ),
    Case(
        equal_voltages_lift_the_body_and_a_larger_front_voltage_raises_the_front.__name__,
        equal_voltages_lift_the_body_and_a_larger_front_voltage_raises_the_front,
        at_rest=True,
    ),
)
