"""Causes every event of docs' safety.md at random moments; measures time to zero volts, motion."""

from __future__ import annotations

import os
import statistics
import sys
from collections import Counter
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor

from heli3dof.rig.profile import default_profile
from tests.bench import Figure, Table, at_most
from tests.drivers.firmware.building import COMPILER
from tests.safety.bench import CALLED_S
from tests.safety.moments import (
    CALM,
    EMULATED,
    FIRMWARE,
    NEED_A_PROCESS,
    RATE_HZ,
    SEED,
    SWITCHES,
    Case,
    Run,
    cases,
    fly_again_where_held_up,
)
from tests.safety.table import BY_NAME, NO_EFFECT

TITLE = "Safety: every fault at random moments"
MOMENTS = int(os.environ.get("SAFETY_MOMENTS", "10"))
"""Number of random moments, for each event and device"""
IN_REAL_TIME = 4
"""Real-time flights at once: they mostly sleep"""
TURN_S = 2e-3
"""s, tolerance of the firmware: 1 ms between outputs, 1 ms of its watchdog"""
INTRO = (
    f"Every row of [safety.md](safety.md) at random moments (seed {SEED}) of a flight from the "
    "table and back: arming, take-off, a step of 10° in roll and 20° in yaw, landing. The flight "
    "is divided into equal parts and every part has one moment. *Virtual*: the emulated rig in "
    "the flight's process on a virtual clock, 500 Hz, limits of the default profile. *Line*: "
    f"`heli3dof` in a process of its own at {RATE_HZ} Hz in real time, the device behind a "
    "pseudo-terminal; its times include delays of this machine, which runs several flights at "
    "once. Watchdogs are 0.3 s there and the ramp takes 1.5 s. Times run from the instant in "
    "*counted from* to zero volts; roll and roll rate are the plant's, from the event on. "
    "*Outcome as stated*: exit code, outcome and message are the row's. *Roll rate at the table*: "
    "of the arm as it reaches the table. *In time* allows the lateness of the loop in the "
    "recording, at the beginning and at the end of a ramp, and the time grid of the device: a "
    f"period of the emulated rig, {1e3 * CALLED_S:g} ms of the thread that serves it behind a "
    f"pseudo-terminal, {1e3 * TURN_S:g} ms of the firmware."
)  # fmt: skip
WHY = {
    "laptop_suspend": "the flight's process is stopped for 1 s and its CLOCK_BOOTTIME goes on by "
    "600 s; the computer itself is not suspended",
    "full_disk": "the recording's writes fail with ENOSPC",
    "late_ticks": "every period is delayed by 40 ms in the flight's process",
    "envelope_trip": "the highest roll of the envelope is set below the present roll; the envelope "
    "does not check the ramp",
    "saturated_for_too_long": "the controller requests twice the limit on both motors, "
    "`saturated_max_s` is 0.2 s; the ramp has no controller",
    "exception_in_the_controller": "the controller raises; the ramp has no controller",
    "nan_from_the_controller": "the controller returns NaN; the ramp has no controller",
    "stalled_motor": "the drill counts from arming",
    "device_reset": "firmware: the drill counts from arming; emulated rig: any time",
    "kill_9": "needs a process",
    "stopped_process": "needs a process; SIGSTOP for 1 s",
    "estop_from_a_second_terminal": "needs a process; another one calls "
    "`heli3dof.rig.session.estop.request_estop`",
    "cable_out": "needs a line; the port disappears",
    "lost_frames": "needs a line; it carries no commands, or no samples, in turn for 0.45 s, "
    "`lost_max_s` is 0.2 s",
    "second_process": "needs a process",
    "encoder_jump": "by −200 counts, each axis in turn",
    "frozen_encoder": "each axis in turn",
    "amplifier_fault": "overcurrent; the drill counts from arming",
    "button": "the drill counts from arming",
}
"""Event → how the benchmark causes it"""


def measure() -> list[Figure | Table]:
    runs = fly_all([c for c in cases(MOMENTS) if COMPILER or c.device != FIRMWARE])
    groups = {
        (row, device): [r for r in runs if (r.case.row, r.case.device) == (row, device)]
        for row in (CALM, *BY_NAME)
        for device in (EMULATED, FIRMWARE)
    }
    flown = {key: group for key, group in groups.items() if group}
    events = [r for r in runs if r.case.row != CALM and r.in_flight]
    late = [r for r in events if not in_time(r)]
    other = [r for r in events if not (r.as_claimed or r.at_rest)]
    at_rest = [r for r in events if r.at_rest]
    live = [r for r in runs if r.zero_s == float("inf")]
    broken = [r for r in runs if r.wrong]
    missed = [r for r in runs if r.event_s is None]
    how = f"{len(events)} events between arming and zero volts, of {len(runs)} flights"
    return [
        at_most("motors not at zero at the end", len(live), 0, "", how=named(live) or how),
        at_most("zero volts later than stated", len(late), 0, "", how=named(late) or how),
        at_most("outcome other than stated", len(other), 0, "", how=named(other) or how),
        at_most("flights with an error of the bench", len(broken), 0, "", how=named(broken)),
        Figure(
            "encoder frozen in the ramp without later motion: detected",
            f"{sum(r.as_claimed for r in at_rest)} of {len(at_rest)}",
            how="pitch or yaw, or roll on the table",
        ),
        Figure("flights that ended before their event", str(len(missed)), how=named(missed)),
        Figure(
            "flights repeated: a host stall delayed the loop by more than 0.15 s, or ended the "
            "flight",
            str(sum(r.again for r in runs)),
        ),
        Table(
            "Time to zero volts, and motion of the arm",
            ("row", "device", "events (opening, arming, take-off, step, ramp, after)",
             "counted from",
             "stated, ms", "median, ms", "longest, ms", "in time", "highest roll, °",
             "highest roll rate at the table, °/s", "outcome as stated"),
            tuple(line(*key, group) for key, group in flown.items()),
        ),
        Table(
            "Outcomes of flights with the event before arming or after zero volts",
            ("device", "when", "flights", "exit code and outcome"),
            tuple(outside(runs)),
        ),
        Table(
            "How the bench causes each event",
            ("row", "emulated rig", "firmware", "how"),
            tuple(made(row) for row in BY_NAME),
        ),
    ]  # fmt: skip


def fly_all(flights: list[Case]) -> list[Run]:
    runs: list[Run] = []
    for chosen, at_once in (
        ([c for c in flights if not c.virtual], IN_REAL_TIME),
        ([c for c in flights if c.virtual], os.cpu_count() or 1),
    ):
        with ProcessPoolExecutor(at_once) as pool:
            for run in pool.map(fly_again_where_held_up, chosen):
                runs.append(run)
                report(run)
    return runs


def report(run: Run) -> None:
    """Print a flight on stderr if its outcome or time is not as safety.md states."""
    if run.wrong or (
        run.case.row != CALM and run.in_flight and not (in_time(run) and run.as_claimed)
    ):
        took = "" if run.took_s is None else f"{1e3 * run.took_s:.1f} ms of {1e3 * run.bound_s:g}"
        print(
            f"  {run.case} ({run.phase}): {took}, late {1e3 * run.late_s:.1f} ms, {run.code} "
            f"{run.ending}: {run.detail[:160]} {run.wrong}",
            file=sys.stderr, flush=True,
        )  # fmt: skip


def in_time(run: Run) -> bool:
    """True if zero volts came within the stated time, lateness and the device's time grid added."""
    if run.took_s is None:
        return True
    grid_s = default_profile().dt if run.case.virtual else CALLED_S
    if run.case.device == FIRMWARE:
        grid_s = TURN_S
    return run.took_s <= run.bound_s + 2 * run.late_s + grid_s + 1e-6


def line(row: str, device: str, runs: list[Run]) -> tuple[str, ...]:
    """Returns the table row of an event on one device."""
    events = [r for r in runs if r.in_flight]
    timed = [r for r in events if r.took_s is not None]
    took = [1e3 * (r.took_s or 0.0) for r in timed]
    phases = Counter(r.phase for r in runs)
    shown = "/".join(
        str(phases[p]) for p in ("opening", "arming", "take-off", "step", "ramp", "over")
    )
    rolls = [r.roll_max_deg for r in events]
    speeds = [r.table_deg_per_s for r in events if r.table_deg_per_s is not None]
    known = BY_NAME.get(row)
    claimed = known is not None and known.zero is not NO_EFFECT and took
    return (
        "no fault" if known is None else known.what,
        f"{device}, {'virtual' if runs[0].case.virtual else 'line'}",
        shown,
        known.zero.since if known is not None and claimed else "–",
        f"{1e3 * max(r.bound_s for r in runs):g}" if claimed else "–",
        f"{statistics.median(took):.1f}" if claimed else "–",
        f"{max(took):.1f}" if claimed else "–",
        f"{sum(map(in_time, timed))} of {len(timed)}" if claimed else "–",
        f"{max(rolls):.1f}" if rolls else "–",
        f"{max(speeds):.0f}" if speeds else "–",
        "–" if known is None else f"{sum(r.as_claimed for r in events)} of {len(events)}",
    )


def made(row: str) -> tuple[str, ...]:
    """Returns the table row of how the benchmark causes an event on each device."""
    emulated = "line" if row in NEED_A_PROCESS else "virtual"
    firmware = "line, drill" if row in SWITCHES else "line"
    return BY_NAME[row].what, emulated, firmware, WHY.get(row, "the signal")


def outside(runs: list[Run]) -> Iterable[tuple[str, ...]]:
    """Yields table rows of the outcomes of events while no motor ran."""
    for device in (EMULATED, FIRMWARE):
        for phase, when in (("opening", "before arming"), ("over", "after zero volts")):
            result = [r for r in runs if (r.case.device, r.phase) == (device, phase)]
            ends = Counter(f"{r.code} {r.ending or 'no recording'}" for r in result)
            texts = (f"{n} × {end}" for end, n in ends.most_common())
            if result:
                yield device, when, str(len(result)), ", ".join(texts)


def named(runs: Iterable[Run]) -> str:
    """Returns the first twelve of these runs as text."""
    texts = [f"{r.case.row} {r.case.device} {r.phase} at {r.case.moment_s:g} s" for r in runs]
    return "; ".join(texts[:12]) + (f"; and {len(texts) - 12} more" if len(texts) > 12 else "")
