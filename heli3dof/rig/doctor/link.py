"""Checks the open rig: identity, state, round trip, loss, clock, noise, rest angles.

All checks use `Rig.read`; the rig is never armed.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import degrees

from heli3dof.axes import AXES
from heli3dof.rig.clock import wait_until
from heli3dof.rig.doctor import RIG, checks_of, verdict
from heli3dof.rig.interface import Check, Flags, Sample
from heli3dof.rig.link_counters import count_of
from heli3dof.rig.profile import Profile
from heli3dof.rig.session.stoppable_rig import StoppableRig

COUNTERS = ("retries", "malformed")
POLLS = 500
EVERY_S = 2e-3
"""s between readings: 1 s in all, enough to compare the clocks"""
LONGEST_S = 3.0
"""s: time limit for all readings, which only a slow rig reaches"""
LONGEST_WATCHDOG_S = 0.5
"""s: a longer watchdog is reported"""
STILL_COUNTS = 2
"""counts: largest range at rest; the reading of an encoder between two counts alternates by one"""
REST = "let the rig rest, then heli3dof zero"
CABLE = "a shorter, shielded cable away from the motors' leads; ground at one end; lower baud"
ONE_TURN = 360.0
"""°: neither the arm nor the yaw axis with its cable can get this far beyond the envelope"""


@dataclass(frozen=True)
class Opened:
    """An open rig, its profile and a series of its readings: the argument of each check."""

    rig: StoppableRig
    profile: Profile
    samples: list[Sample]
    took_s: list[float]
    """s from request to sample, of each reading"""
    retries: int | None
    """Requests that the driver repeated; None: it does not count them"""
    malformed: int | None
    """Malformed frames received; None: the driver does not count them"""


def listen(rig: StoppableRig, profile: Profile) -> Opened:
    """Read the rig `POLLS` times, for `LONGEST_S` s at most; return the readings."""
    before = [count_of(rig.statistics, name) for name in COUNTERS]
    samples, took = [], []
    first = time.monotonic()
    for k in range(POLLS):
        start = wait_until(first + k * EVERY_S)
        samples.append(rig.read())
        now = time.monotonic()
        took.append(now - start)
        if now > first + LONGEST_S:
            break
    after = [count_of(rig.statistics, name) for name in COUNTERS]
    retries, malformed = map(_less, after, before)
    return Opened(rig, profile, samples, took, retries, malformed)


def identity(opened: Opened) -> Check:
    """Return a `Check` that the device fits the profile.

    It fits if its counts per revolution are the profile's, and if its voltage limit is at least the
    profile's.
    """
    found, profile = opened.rig.identity, opened.profile
    e = profile.encoder
    stated = (
        f"{found.model}, serial {found.serial}, firmware {found.firmware}, "
        f"protocol {found.protocol}"
    )
    ours, theirs = (e.roll, e.pitch, e.yaw), found.counts_per_rev
    if theirs != ours:
        stated += f"; it counts {theirs} per revolution, the profile {ours}"
        fix = f"--profile with the rig's own, or correct encoder.{_differs(ours, theirs)} in it"
        return Check("identity", stated, False, fix)
    if found.v_max < profile.motor.v_max:
        stated += f"; its limit is {found.v_max:g} V, the profile's {profile.motor.v_max:g} V"
        return Check("identity", stated, False, f"motor.v_max = {found.v_max:g} in the profile")
    return Check("identity", stated, True)


def watchdog(opened: Opened) -> Check:
    """Return a `Check` that the device's watchdog timeout is at most `LONGEST_WATCHDOG_S` s."""
    seconds = opened.rig.identity.watchdog_s
    found = f"motors to zero after {seconds * 1e3:g} ms of silence"
    fix = "?watchdog_s=0.1 in the device URL, or the firmware's own setting"
    return verdict("watchdog", found, seconds <= LONGEST_WATCHDOG_S, fix)


def round_trip(opened: Opened) -> Check:
    """Return a `Check` of the time from the request to the arrival of a sample.

    Its median must be at most half a control period, its 99.9 % quantile at most one period.
    """
    took = sorted(opened.took_s)
    n, dt = len(took), opened.profile.dt
    usual, rare = took[n // 2], took[min(n - 1, int(0.999 * n))]
    found = f"{usual * 1e6:.0f} µs at the median, {rare * 1e6:.0f} µs at 99.9 %, of {n} readings"
    if usual > dt / 2:
        fix = "the latency timer (above), a higher ?baud=, or a lower loop.rate_hz in the profile"
        return Check("round trip", f"{found}: too slow for {1 / dt:g} Hz", False, fix)
    if rare > dt:
        found += ": sometimes longer than a period"
    fix = "see wake-up: this computer or the line pauses; connect nothing else to the USB hub"
    return verdict("round trip", found, rare <= dt, fix)


def loss(opened: Opened) -> Check:
    """Return a `Check` that the driver repeated no request and received no malformed frame.

    The result is undecided (``good`` None) if the driver does not count these events.
    """
    if opened.retries is None or opened.malformed is None:
        return Check("loss", "this driver does not count it", None)
    n = len(opened.samples)
    found = f"{opened.retries} retries in {n} readings, {opened.malformed} malformed frames"
    return verdict("loss", found, not (opened.retries or opened.malformed), CABLE)


def device_clock(opened: Opened) -> Check:
    """Return a `Check` that the rates of the device's clock and the host's agree within 1 %.

    The measurement's uncertainty is added to the limit. The result is undecided (``good`` None) if
    the clocks cannot be compared, e.g. if the device's clock is virtual.
    """
    first, last = opened.samples[0], opened.samples[-1]
    theirs = last.device_time_s - first.device_time_s
    ours = last.host_time_s - first.host_time_s
    if opened.rig.identity.timebase == "virtual" or ours < 0.05:
        return Check("device's clock", "not compared: virtual, or too short a time", None)
    if theirs == 0 and opened.rig.identity.timebase == "host":
        return Check("device's clock", "not compared: it advances only with commands", None)
    off = theirs / ours - 1
    # Either end is uncertain by one reading's time.
    unsure = 2 * max(opened.took_s) / ours
    found = f"{off * 100:+.2f} % against the host's (± {unsure * 100:.2f} %)"
    fix = "correct the clock or tick setting of the firmware"
    return verdict("device's clock", found, abs(off) <= 0.01 + unsure, fix)


def stands_still(opened: Opened) -> Check:
    """Return a `Check` that each encoder count of the resting rig varies by at most `STILL_COUNTS`.

    Electrical noise, or a rig that moves, would cause a larger range.
    """
    spans = [
        max(column) - min(column)
        for column in zip(*(s.counts for s in opened.samples), strict=True)
    ]
    worst = max(range(3), key=lambda i: spans[i])
    still = spans[worst] <= STILL_COUNTS
    found = "still" if still else f"{AXES[worst]} changed by {spans[worst]} counts"
    fix = "let the rig rest and try again; else check that encoder's cable and shield"
    return verdict("encoders at rest", found, still, fix)


def state(opened: Opened) -> Check:
    """Return a `Check` that the last sample reports no fault, no stalled motor, no armed rig."""
    flags = opened.samples[-1].flags
    problems = {
        Flags.FAULT: ("the amplifier reports a fault", "let it cool, check supply and motors"),
        Flags.STALL: ("a motor is stalled", "switch off, free the propeller"),
        Flags.ENABLED: ("another program has armed the rig", "heli3dof estop"),
    }
    for flag, (found, fix) in problems.items():
        if flags & flag:
            return Check("state", found, False, fix)
    held = " ".join(flag.name or "" for flag in (Flags.LATCHED, Flags.ESTOP) if flags & flag)
    found = f"{held.lower()}: the next flight clears it" if held else "idle, output zero"
    return Check("state", found, True)


def rest_angles(opened: Opened) -> Check:
    """Return a `Check` that the rig is at its rest angles and within the profile's limits.

    The angles follow from the counts and the stored calibration. The check fails if an angle is
    outside the limits, which would end any flight in its first period. An angle more than
    `ONE_TURN` outside shows a faulty counter. The result is undecided (``good`` None)
    if roll or pitch is more than 3° from its rest angle. It is also undecided if `RestCounts.note`
    states a doubt about the calibration, e.g. that the device has restarted since.
    """
    rest, profile = opened.rig.rest, opened.profile
    counts = opened.samples[-1].counts
    off = [degrees(counts[i] * q) for i, q in enumerate(profile.encoder.rad_per_count)]
    away = ", ".join(f"{axis} {each:+.1f}°" for axis, each in zip(AXES, off, strict=True))
    origin = {"zero": "as stored by heli3dof zero", "power-up": "counts since the device started"}
    found = f"{origin[rest.known_from]}; away from rest now: {away}"
    for i, (low, high) in enumerate(profile.limits.ranges_deg):
        reading = degrees(profile.encoder.rest_rad[i]) + off[i]
        if low <= reading <= high:
            continue
        found = (
            f"{found}; {AXES[i]} reads {reading:.1f}°, beyond the envelope's {low:g}° to {high:g}°"
        )
        fix = REST
        if abs(reading) > max(-low, high) + ONE_TURN:
            fix = (
                f"switch the device off, let the rig rest, and switch it on; if {AXES[i]} reads "
                "the same again, its counter has another width or is not reset"
            )
        return Check("rest angles", found, False, fix)
    if rest.note:
        return Check("rest angles", f"{found}; {rest.note}", None, "heli3dof zero")
    if max(map(abs, off[:2])) > 3.0:
        return Check("rest angles", found, None, REST)
    return Check("rest angles", found, True)


GROUP = RIG
CHECKS: tuple[Callable[[Opened], Check], ...] = (
    identity, state, watchdog, round_trip, loss, device_clock, stands_still, rest_angles,
)  # fmt: skip


def checks(rig: StoppableRig, profile: Profile) -> Iterator[Check]:
    """Read the rig several times, run every check on the readings, and yield the results."""
    opened = listen(rig, profile)
    for check in checks_of(GROUP):
        yield check(opened)


def _less(after: int | None, before: int | None) -> int | None:
    return None if after is None or before is None else after - before


def _differs(ours: tuple[int, ...], theirs: tuple[int, ...]) -> str:
    return next(a for a, x, y in zip(AXES, ours, theirs, strict=True) if x != y)
