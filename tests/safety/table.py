"""docs/safety.md's table: what may go wrong, what becomes of it, and when the volts are gone.

The rows are data: a test of the same name (`test_` and the row's name) shows each one, and takes
its exit code, outcome, words and time from here. ``python -m tests.safety.table docs/safety.md``
writes the page's tables anew.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass

from heli3dof import pages
from heli3dof.rig.profile import Limits, Profile, default_profile
from heli3dof.rig.session.estop import PATIENCE_S
from tests.paths import ROOT

BENCHMARKS = ROOT / "docs" / "benchmarks.json"
"""What `python -m tests.bench` keeps"""

WATCHDOG_S = 0.1
DEVICE_RAMP_S = 0.2
"""Of the emulated rig and of the firmware, where they are not told otherwise"""


@dataclass(frozen=True)
class Bound:
    """How long until zero volts; from when, and how that is reckoned."""

    formula: str
    since: str
    seconds: Callable[[Profile, float], float]
    """of the profile and the device's watchdog in s"""

    def cell(self) -> str:
        """As the table shows it, for the profile that is used when none is given."""
        s = self.seconds(default_profile(), WATCHDOG_S)
        return f"{1e3 * s:g} ms after {self.since} ({self.formula})"


def ramp(since: str) -> Bound:
    """The host ramps, beginning in the period that follows."""
    return Bound(
        "1 period + `ramp_down_s`", since, lambda p, watchdog_s: p.dt + p.limits.ramp_down_s
    )


def at_once(since: str) -> Bound:
    """The host stops the device in the period that follows."""
    return Bound("2 periods", since, lambda p, watchdog_s: 2 * p.dt)


ASKED = Bound(
    "0.2 s in which the flight answers, or the device is stopped past it + 2 periods",
    "the request",
    lambda p, watchdog_s: PATIENCE_S + 2 * p.dt,
)
WATCHDOG = Bound(
    "the device's watchdog + its ramp",
    "the last command",
    lambda p, watchdog_s: watchdog_s + DEVICE_RAMP_S,
)
BY_ITSELF = Bound("in the same instant", "it happens", lambda p, watchdog_s: 0.0)
NOTHING = Bound("nothing happens to it", "it", lambda p, watchdog_s: 0.0)


@dataclass(frozen=True)
class Row:
    """One thing that goes wrong."""

    name: str
    what: str
    notices: str
    device: str
    zero: Bound
    ending: str
    said: str
    """What the recording's detail holds"""
    exit_code: int
    shown: str = ""
    """How the page shows that, where it is only an example of it"""

    def cells(self) -> list[str]:
        said = self.shown or self.said
        says = f"`{self.ending}`: {said}" if said else self.ending
        code = "killed" if self.exit_code < 0 else str(self.exit_code)
        zero = "–" if self.zero is NOTHING else self.zero.cell()
        return [self.what, self.notices, self.device, zero, says, code]


LOOP, DEVICE = "the loop", "the device"
RAMPED = "is ramped to zero by commands"
STOPPED = "is told to stop: zero at once, until armed"
LATCHES = "ramps to zero by itself and latches, until armed"
ROWS = [
    Row("ctrl_c", "Ctrl-C", LOOP, RAMPED, ramp("the signal"),
        "interrupted", "stopped with Ctrl-C", 130),
    Row("second_ctrl_c", "a second Ctrl-C", LOOP, STOPPED, at_once("the signal"),
        "tripped", "emergency stop, by a second Ctrl-C", 4),
    Row("sigterm", "SIGTERM", LOOP, RAMPED, ramp("the signal"),
        "interrupted", "stopped by a request to terminate (SIGTERM)", 130),
    Row("terminal_closed", "the terminal is closed (SIGHUP)", LOOP, RAMPED, ramp("the signal"),
        "interrupted", "stopped since the terminal was closed (SIGHUP)", 130),
    Row("estop_from_a_second_terminal", "`heli3dof estop` from a second terminal", LOOP, STOPPED,
        ASKED, "tripped", "emergency stop on request", 4),
    Row("kill_9", "`kill -9`, a crash, the computer dies", DEVICE, LATCHES, WATCHDOG,
        "none, and `heli3dof recover` brings the file back", "", -9),
    Row("stopped_process", "Ctrl-Z, a process that hangs", DEVICE, LATCHES, WATCHDOG,
        "tripped", "the device's watchdog expired", 4),
    Row("laptop_suspend", "the laptop is suspended", "the device; the loop when it wakes",
        LATCHES + "; on waking it " + STOPPED, WATCHDOG,
        "tripped", "the computer slept", 4),
    Row("exception_in_the_controller", "an exception in the controller", LOOP, RAMPED,
        ramp("it"), "error", "ZeroDivisionError", 1, "what was raised"),
    Row("nan_from_the_controller", "NaN from the controller", LOOP,
        RAMPED + " from the last voltage", ramp("it"),
        "tripped", "the controller asked for nan V", 4),
    Row("encoder_jump", "an encoder jumps", "the loop (`Jump`)", RAMPED, ramp("the jump"),
        "tripped", "encoder jumped by", 4, "which encoder jumped, by how many counts"),
    Row("frozen_encoder", "an encoder freezes", "the loop (`FrozenEncoder`, `SilentEncoder`)",
        RAMPED, ramp("it is noticed"), "tripped", "encoder's count stood at", 4,
        "which encoder's count stood still, for how long, and what its axis did meanwhile"),
    Row("envelope_trip", "an angle, rate, voltage or time beyond the envelope", LOOP, RAMPED,
        ramp("the sample that shows it"), "tripped", "beyond the envelope's", 4,
        "what was beyond it, and by how much"),
    Row("late_ticks", "half of the last second's periods come late", "the loop (`Late`)",
        RAMPED, ramp("it is noticed"), "tripped", "the loop was too late", 4),
    Row("lost_frames", "samples, or commands, are lost in a row", "the loop (`Lost`)", RAMPED,
        ramp("it is noticed"), "tripped", "the line loses frames", 4),
    Row("saturated_for_too_long", "a motor at its limit for too long", "the loop (`Saturated`)",
        RAMPED, ramp("it is noticed"), "tripped", "was at its limit", 4),
    Row("cable_out", "the cable is pulled out", "the device, and the loop", LATCHES, WATCHDOG,
        "device", "gone", 3, "the line is gone, or the rig has gone silent"),
    Row("device_reset", "the device restarts (brown-out, crash)", "the device, and the loop",
        "starts with the amplifier disabled; its counts begin at zero where the rig was then",
        BY_ITSELF, "device", "has restarted", 3, "the device has restarted"),
    Row("stalled_motor", "a motor is stalled", DEVICE, "stops by itself, until armed", BY_ITSELF,
        "tripped", "a motor is stalled", 4),
    Row("amplifier_fault", "overcurrent, over-temperature", DEVICE,
        "stops by itself; arms again when the amplifier does", BY_ITSELF,
        "tripped", "the amplifier reports a fault", 4),
    Row("button", "the rig's own button", DEVICE, "stops by itself, until armed", BY_ITSELF,
        "tripped", "an emergency stop is in force", 4),
    Row("full_disk", "the disk is full, or fails", "the loop, from its recorder", RAMPED,
        ramp("it is noticed"), "error", "no space left", 5),
    Row("second_process", "a second process opens the rig", "its session's lock",
        "flies on undisturbed", NOTHING, "completed", "", 3),
]  # fmt: skip
BY_NAME = {row.name: row for row in ROWS}
HEAD = ["what happens", "who notices", "the device", "zero volts within", "the recording says",
        "exit code"]  # fmt: skip
LIMITS = {
    "late_max_s": "a period that comes later than this is late …",
    "late_max_share": "… and more than this share of the last second's: land",
    "lost_max_s": "samples, or commands, lost in a row for longer: land. Keep it below the "
    "watchdog's time, after which the device falls out by itself",
    "saturated_max_s": "a motor at its limit for longer: land",
    "ramp_down_s": "the ramp from hover to zero after a trip or an interrupt",
}


def table() -> str:
    """The table in Markdown."""
    return pages.table(HEAD, [row.cells() for row in ROWS])


def limits() -> str:
    """What a profile may set of the monitors' numbers."""
    given = Limits()
    rows = [[f"`{key}`", f"{getattr(given, key):g}", LIMITS[key]] for key in LIMITS]
    return pages.table(["key", "default", "meaning"], rows)


def ramp_down() -> str:
    """The laws of the way to zero side by side, as `make bench TOPIC=ramp_down` measured them."""
    measured = json.loads(BENCHMARKS.read_text(encoding="utf-8"))["ramp_down"]["tables"]
    return "\n\n".join(
        f"{each['caption']}:\n\n{pages.table(each['head'], each['rows'])}" for each in measured
    )


PAGE = pages.Page("tests.safety.table", {"table": table, "ramp_down": ramp_down, "limits": limits})

if __name__ == "__main__":
    PAGE.main()
