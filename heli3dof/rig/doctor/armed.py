"""Checks that need an armed rig: samples lost in the loop, the watchdog, the emergency stop.

These checks are for ``doctor --arm``. Every command is zero volts, so nothing turns unless the
amplifier is broken. Keep your hands off the propellers.

    arm → zero volts at the control rate for a second → silence until the watchdog must have
    expired → arm → emergency stop → arm → close
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

from heli3dof.rig.doctor import ARMED, checks_of
from heli3dof.rig.doctor.link import CABLE
from heli3dof.rig.interface import Check, Command, Flags, Sample
from heli3dof.rig.link_counters import count_of
from heli3dof.rig.profile import Profile
from heli3dof.rig.session.stoppable_rig import StoppableRig

SECONDS = 1.0
LONGEST_RAMP_S = 0.5
"""s: the longest ramp from the watchdog's expiry to zero volts"""
LOST_SHARE = 1e-3
"""Largest share of samples that may be missing"""
WHERE = {
    "lost": "lost on the line",
    "device_skipped": "skipped by the device",
    "samples_stale": "read too late by this computer",
}
"""The link's counters of missing samples (`HasLinkStatistics`), in words"""
FIXES = {
    "lost": CABLE,
    "device_skipped": "a lower loop.rate_hz in the profile: the device does not keep up",
    "samples_stale": "see wake-up above: this computer pauses",
}


class Armed:
    """Sends zero volts to both motors of an open rig in every control period."""

    def __init__(self, rig: StoppableRig, profile: Profile) -> None:
        self.rig, self.dt = rig, profile.dt
        self.sequence = 0
        self.due = 0.0

    def arm(self) -> Sample:
        sample = self.rig.arm()
        self.due = sample.host_time_s
        return sample

    def zero_volts(self) -> Sample:
        """Send zero volts to both motors; return the next sample."""
        self.sequence += 1
        self.due = max(self.due + self.dt, time.monotonic())
        return self.rig.exchange(Command(self.sequence, 0.0, 0.0), self.due)


def traffic(armed: Armed) -> Check:
    """Return a `Check` that at most the fraction `LOST_SHARE` of the samples is missing.

    The device's clock gives the number of samples that were due within `SECONDS` s. The check also
    fails if the last sample's output is not zero volts.
    """
    first = last = armed.arm()
    counts_before = _missing_by_cause(armed.rig)
    came = 0
    until = time.monotonic() + SECONDS
    worst = 0.0
    while time.monotonic() < until:
        before, last = last, armed.zero_volts()
        came += 1
        worst = max(worst, last.host_time_s - before.host_time_s)
    due = max(came, round((last.device_time_s - first.device_time_s) / armed.dt))
    found = (
        f"{came} of {due} samples came at {1 / armed.dt:g} Hz; at most "
        f"{worst * 1e3:.1f} ms between two"
    )
    if any(abs(v) > 0 for v in last.v_applied):  # NaN: not measured
        volts = "{:g} and {:g} V".format(*last.v_applied)
        fix = "switch off; have the amplifier repaired"
        return Check("zero volts", f"the output is {volts}; zero was commanded", False, fix)
    if due - came <= LOST_SHARE * due:
        return Check("traffic of the loop", found, True)
    missing = {why: n - counts_before[why] for why, n in _missing_by_cause(armed.rig).items()}
    if not missing:
        fix = "see wake-up and round trip above: this computer or the line pauses"
        return Check("traffic of the loop", found, False, fix)
    counted = ", ".join(f"{n} {WHERE[why]}" for why, n in missing.items() if n)
    fix = FIXES[max(missing, key=lambda why: missing[why])]
    return Check("traffic of the loop", f"{found}; {counted}" if counted else found, False, fix)


def _missing_by_cause(rig: StoppableRig) -> dict[str, int]:
    """Return {cause: number of samples missing so far} for the three causes in `WHERE`.

    The result is {} if the rig's link does not count the missing samples of every cause.
    """
    counts = {why: count_of(rig.statistics, why) for why in WHERE}
    found = {why: n for why, n in counts.items() if n is not None}
    return found if len(found) == len(WHERE) else {}


def watchdog_expires(armed: Armed) -> Check:
    """Return a `Check` that the watchdog disables the amplifier if no commands arrive.

    The amplifier must stay disabled when commands arrive again. The result is undecided (``good``
    None) for a rig with a virtual clock.
    """
    what, rig = "watchdog at work", armed.rig
    if rig.identity.timebase == "virtual":
        return Check(what, "not checked: a virtual clock does not advance in the silence", None)
    armed.arm()
    armed.zero_volts()
    time.sleep(rig.identity.watchdog_s + LONGEST_RAMP_S)
    # The first exchange ends a period that began before the silence.
    armed.zero_volts()
    flags = armed.zero_volts().flags
    if flags & Flags.LATCHED and not flags & Flags.ENABLED:
        return Check(what, "expired in the silence, and latched", True)
    fix = "do not fly this device: nothing stops it when the cable comes out; correct its firmware"
    return Check(what, "DID NOT EXPIRE in the silence", False, fix)


def stop_holds(armed: Armed) -> Check:
    """Return a `Check` that commands do not end an emergency stop, and that arming ends it."""
    what = "emergency stop at work"
    armed.arm()
    armed.zero_volts()
    armed.rig.estop("heli3dof doctor")
    flags = armed.zero_volts().flags
    if not flags & Flags.ESTOP or flags & Flags.ENABLED:
        fix = "do not fly this device: correct its firmware"
        return Check(what, "the device did not stay stopped", False, fix)
    again = armed.arm().flags
    if not again & Flags.ENABLED or again & Flags.ESTOP:
        return Check(what, "stopped, but does not arm again", False, "switch it off and on")
    return Check(what, "stopped at once, held, and armed again", True)


GROUP = ARMED
CHECKS: tuple[Callable[[Armed], Check], ...] = (traffic, watchdog_expires, stop_holds)


def checks(rig: StoppableRig, profile: Profile) -> Iterator[Check]:
    """Run the checks, which arm ``rig``; yield their results, and stop the rig at the end."""
    armed = Armed(rig, profile)
    for check in checks_of(GROUP):
        yield check(armed)
    rig.estop("heli3dof doctor is done")
