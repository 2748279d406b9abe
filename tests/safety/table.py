"""The tables of docs/reference/safety.md: faults, their outcome, and the time until zero volts.

Each row has a test (`test_` and the row's name), which takes exit code, outcome, message and time
from here. ``python -m tests.pages`` rewrites the page's tables.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass

from heli3dof.rig.profile import Profile, default_profile
from heli3dof.rig.session.estop import PATIENCE_S
from tests.pages.page import Page
from tests.pages.page import table as markdown_table
from tests.paths import ROOT

BENCHMARKS = ROOT / "docs" / "results" / "benchmarks.json"
"""Written by `python -m tests.bench`"""

WATCHDOG_S = 0.1
DEVICE_RAMP_S = 0.2
"""s: defaults of the emulated rig and of the firmware"""


@dataclass(frozen=True)
class Bound:
    """Time until zero volts: from when, and its formula."""

    formula: str
    since: str
    seconds: Callable[[Profile, float], float]
    """of the profile and the device's watchdog (s)"""

    def cell(self) -> str:
        """The table's cell, for the default profile."""
        s = self.seconds(default_profile(), WATCHDOG_S)
        return f"{1e3 * s:g} ms: {self.formula}"


def ramp(since: str) -> Bound:
    """The host ramps, from the next period on."""
    return Bound(
        "1 period + `ramp_down_s`", since, lambda p, watchdog_s: p.dt + p.limits.ramp_down_s
    )


def at_once(since: str) -> Bound:
    """The host stops the device in the next period."""
    return Bound("2 periods", since, lambda p, watchdog_s: 2 * p.dt)


REQUESTED = Bound(
    "0.2 s for the flight's answer + 2 periods",
    "the request",
    lambda p, watchdog_s: PATIENCE_S + 2 * p.dt,
)
WATCHDOG = Bound(
    "watchdog time + ramp time of the device",
    "the last command",
    lambda p, watchdog_s: watchdog_s + DEVICE_RAMP_S,
)
INSTANT = Bound("in the same instant", "the fault", lambda p, watchdog_s: 0.0)
NO_EFFECT = Bound("no effect", "it", lambda p, watchdog_s: 0.0)


@dataclass(frozen=True)
class Row:
    """A fault, and its outcome."""

    name: str
    what: str
    notices: str
    device: str
    zero: Bound
    ending: str
    detail: str
    """Part of the recording's detail"""
    exit_code: int
    shown: str = ""
    """On the page instead of ``detail``, if that is only an example"""

    def cells(self) -> list[str]:
        detail = self.shown or self.detail
        outcome = f"`{self.ending}`: {detail}" if detail else self.ending
        code = "killed" if self.exit_code < 0 else str(self.exit_code)
        return [self.what, self.notices, self.device, outcome, code]


LOOP, DEVICE = "the loop", "the device"
RAMPED = "ramp"
STOPPED = "stop command"
LATCHES = "watchdog"
OWN_STOP = "own stop"
ROWS = [
    Row("ctrl_c", "Ctrl-C", LOOP, RAMPED, ramp("the signal"),
        "interrupted", "stopped with Ctrl-C", 130),
    Row("second_ctrl_c", "a second Ctrl-C", LOOP, STOPPED, at_once("the signal"),
        "tripped", "emergency stop, by a second Ctrl-C", 4),
    Row("sigterm", "SIGTERM", LOOP, RAMPED, ramp("the signal"),
        "interrupted", "stopped by a request to terminate (SIGTERM)", 130),
    Row("terminal_closed", "the terminal is closed (SIGHUP)", LOOP, RAMPED, ramp("the signal"),
        "interrupted", "stopped because the terminal was closed (SIGHUP)", 130),
    Row("estop_from_a_second_terminal", "`heli3dof estop` from a second terminal", LOOP,
        f"{STOPPED} by `estop`", REQUESTED, "tripped", "emergency stop on request", 4),
    Row("kill_9", "`kill -9`, a crash, the computer dies", DEVICE, LATCHES, WATCHDOG,
        "none; `heli3dof recover` restores the file", "", -9),
    Row("stopped_process", "Ctrl-Z, a process that hangs", DEVICE, LATCHES, WATCHDOG,
        "tripped", "the device's watchdog expired", 4),
    Row("laptop_suspend", "the laptop is suspended", "the device; the loop when it wakes",
        LATCHES + "; on waking: " + STOPPED, WATCHDOG,
        "tripped", "the computer slept", 4),
    Row("exception_in_the_controller", "an exception in the controller", LOOP, RAMPED,
        ramp("it"), "error", "ZeroDivisionError", 1, "the exception"),
    Row("nan_from_the_controller", "NaN from the controller", LOOP,
        RAMPED + " from the last voltage", ramp("it"),
        "tripped", "the controller's output is nan V", 4),
    Row("encoder_jump", "an encoder jumps", "the loop (`EncoderJump`)", RAMPED, ramp("the jump"),
        "tripped", "encoder jumped by", 4, "which encoder jumped, by how many counts"),
    Row("frozen_encoder", "an encoder freezes", "the loop (`FrozenEncoder`, `SilentEncoder`)",
        RAMPED, ramp("detection"), "tripped", "encoder's count stood at", 4,
        "which encoder's count stayed constant, for how long, and the motion of its axis"),
    Row("envelope_trip", "an angle, rate, voltage or time beyond the envelope", LOOP, RAMPED,
        ramp("the sample that shows it"), "tripped", "beyond the envelope's", 4,
        "what was beyond it, and by how much"),
    Row("late_ticks", "half of the last second's periods come late", "the loop (`Lateness`)",
        RAMPED, ramp("detection"), "tripped", "samples came too late", 4),
    Row("lost_frames", "samples, or commands, are lost in a row", "the loop (`LostFrames`)", RAMPED,
        ramp("detection"), "tripped", "the line loses frames", 4),
    Row("amplifier_output", "the amplifier is off, or ignores commands",
        "the loop (`AmplifierOutput`)", STOPPED, at_once("detection"),
        "tripped", "its output does not follow", 4, "its flag or output voltage"),
    Row("saturated_for_too_long", "a motor at its limit for too long", "the loop (`Saturation`)",
        RAMPED, ramp("detection"), "tripped", "was at its limit", 4),
    Row("cable_out", "the cable is pulled out", "the device, and the loop", LATCHES, WATCHDOG,
        "device", "gone", 3, "the line is gone, or the rig has gone silent"),
    Row("device_reset", "the device restarts (brown-out, crash)", "the device, and the loop",
        "restart: amplifier disabled, counts begin at zero",
        INSTANT, "device", "has restarted", 3, "the device has restarted"),
    Row("stalled_motor", "a motor is stalled", DEVICE, OWN_STOP, INSTANT,
        "tripped", "a motor is stalled", 4),
    Row("amplifier_fault", "overcurrent, over-temperature", DEVICE,
        OWN_STOP + "; can be armed only without the fault", INSTANT,
        "tripped", "the amplifier reports a fault", 4),
    Row("button", "the rig's own button", DEVICE, OWN_STOP, INSTANT,
        "tripped", "an emergency stop is in force", 4),
    Row("full_disk", "the disk is full, or fails", "the loop, by its recorder", RAMPED,
        ramp("detection"), "error", "no space left", 5),
    Row("second_process", "a second process opens the rig", "its session's lock",
        "none: the flight continues", NO_EFFECT, "completed", "", 3),
]  # fmt: skip
BY_NAME = {row.name: row for row in ROWS}
HEAD = ["fault", "detected by", "reaction", "outcome in the recording", "exit code"]
REACTIONS = {
    RAMPED: ("the loop ramps the motors to zero", ramp("detection or the signal")),
    STOPPED: (
        "the loop stops the device: zero at once, until armed again",
        at_once("the signal or waking"),
    ),
    f"{STOPPED} by `estop`": ("the same, by the flight; else `estop` stops the device", REQUESTED),
    LATCHES: ("the device ramps to zero, until armed again", WATCHDOG),
    OWN_STOP: ("the device sets zero volts, until armed again", INSTANT),
}
"""Reaction → what it does to the motors, and when they are at zero volts"""
LAWS = ("tripped in", "zero", "V_last", "**band ½**", "host dead")
"""The laws that safety.md compares, of those that `make bench TOPIC=ramp_down` measures"""


def table() -> str:
    """The table in Markdown."""
    return markdown_table(HEAD, [row.cells() for row in ROWS])


def reactions() -> str:
    """The reactions that the table's rows name."""
    rows = [[name, what, bound.since, bound.cell()] for name, (what, bound) in REACTIONS.items()]
    return markdown_table(["reaction", "motors", "counted from", "zero volts within"], rows)


def ramp_down() -> str:
    """The highest roll after a trip under four laws; the CSV files have the other measurements."""
    highest, *_ = json.loads(BENCHMARKS.read_text(encoding="utf-8"))["ramp_down"]["tables"]
    columns = [highest["head"].index(name) for name in LAWS]
    rows = [[row[k] for k in columns] for row in highest["rows"]]
    return f"{highest['caption']}:\n\n{markdown_table([*LAWS], rows)}"


PAGE = Page("docs/reference/safety.md", {"reactions": reactions, "table": table})
RAMP_DOWN_PAGE = Page("docs/results/ramp-down.md", {"ramp_down": ramp_down})
