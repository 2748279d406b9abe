"""Measures how the safety monitors detect frozen encoders: time, missed cases, false trips."""

from __future__ import annotations

import json
import os
import random
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from heli3dof.axes import AXES
from heli3dof.experiment.control_loop.loop import fly
from heli3dof.experiment.control_loop.outcome import Outcome
from heli3dof.experiment.fly import prepare
from heli3dof.experiment.plan import Plan, load_plan, step_plan
from heli3dof.experiment.safety_monitors import monitors_for
from heli3dof.recording.row import CLOSED_LOOP, Row
from heli3dof.recording.still_encoder import STILL_S
from heli3dof.rig.drivers import open_driver
from heli3dof.rig.profile import Profile, default_profile
from tests.bench import Figure, at_most
from tests.drivers.emulated_rigs import firmware_rig
from tests.drivers.firmware.building import rig_program
from tests.experiment.safety_monitors.hovering import hover, patient
from tests.profiles import PATIENT, write_profile

TITLE = "Frozen encoders"
MOVING_DEG_PER_S = 3.0
INTRO = (
    "Every encoder freezes at random moments (seed 14) of three plans: a step of 10° in roll and "
    "20° in yaw, `steps` and `rich`. Emulated rigs differ from their profile by ± 15 % (`spread`), "
    "with random torques of 0.33, 1 and 3 times the default; the C firmware flies its own "
    "plant without noise, in real time at 200 Hz. An axis is in motion if its mean rate exceeded "
    f"{MOVING_DEG_PER_S:g}°/s in the 0.2 s before. False trips are counted in calm hover and in "
    "`rich` flights of such rigs without a fault."
)
MOMENTS = int(os.environ.get("WATCHES_MOMENTS", "20"))
"""Number of flights with a freeze, for each axis and plan"""
HOURS = float(os.environ.get("WATCHES_HOURS", "5"))
"""h of calm flight (hover), and as many of the plan ``rich``"""
WORKERS = os.cpu_count() or 1
PLANS = ("step", "steps", "rich")
NOISE = (1.0, 0.33, 3.0)
CALM_S = 1200.0


@dataclass(frozen=True)
class Frozen:
    """The outcome of one flight in which an encoder froze."""

    plan: str
    axis: str
    at_s: float
    ending: str
    detail: str
    found_s: float | None
    """s from the freeze to the trip; None: found in the ramp to zero, or not at all"""
    moving: bool
    warned: bool
    """True: the summary warns that the encoder's count did not change at the end of the flight"""


def plan_of(name: str) -> Plan:
    return step_plan((10.0, None, 20.0)) if name == "step" else load_plan(name)


def cases(seed: int) -> list[tuple[str, str, float, int]]:
    """Returns the cases as (plan, axis, time of the freeze in s, number)."""
    rng = random.Random(seed)
    made = []
    for plan in PLANS:
        for axis in AXES:
            for _ in range(MOMENTS):
                at_s = round(rng.uniform(0.0, plan_of(plan).duration_s), 3)
                made.append((plan, axis, at_s, len(made)))
    return made


class Course:
    """A recorder that keeps time and angles of the closed-loop rows."""

    def __init__(self) -> None:
        self.t: list[float] = []
        self.angle: list[tuple[float, float, float]] = []

    def append(self, row: Row) -> None:
        if row.phase == CLOSED_LOOP:
            self.t.append(row.t)
            self.angle.append(row.angle)

    def rate_deg_per_s(self, axis: str, at_s: float) -> float:
        """Returns the mean absolute rate in the 100 periods before ``at_s``."""
        i = AXES.index(axis)
        k = min(range(len(self.t)), key=lambda n: abs(self.t[n] - at_s))
        j = max(0, k - 100)
        if k == j:
            return 0.0
        turned = self.angle[k][i] - self.angle[j][i]
        return 57.2958 * abs(turned) / (self.t[k] - self.t[j])

    def still_s(self, axis: str) -> float:
        """Returns for how many s the angle had not changed when the closed loop ended."""
        i = AXES.index(axis)
        last = self.angle[-1][i]
        since = (
            t for t, angle in zip(self.t[::-1], self.angle[::-1], strict=True) if angle[i] != last
        )
        return self.t[-1] - next(since, self.t[0])


def flown(plan: Plan, url: str, profile: Profile, sink: Course) -> Outcome:
    return fly(
        open_driver(url, profile), profile, prepare(plan, profile, 1), sink,
        monitors=monitors_for(profile),
    )  # fmt: skip


def on_the_mock(case: tuple[str, str, float, int]) -> Frozen:
    plan, axis, at_s, n = case
    profile = patient(default_profile().with_controller())
    url = (
        f"mock:?speed=max&seed={1400 + n}&spread=0.15&noise={NOISE[n % 3]:g}"
        f"&fault=frozen.{axis}@{at_s:g}"
    )
    course = Course()
    outcome = flown(plan_of(plan), url, profile, course)
    delay_s = outcome.periods * profile.dt - at_s
    in_air = outcome.ending == "tripped" and outcome.periods * profile.dt < course_end(plan)
    moving = course.rate_deg_per_s(axis, at_s) > MOVING_DEG_PER_S
    return Frozen(
        plan, axis, at_s, outcome.ending, str(outcome.detail), delay_s if in_air else None, moving,
        course.still_s(axis) > STILL_S,
    )  # fmt: skip


def course_end(plan: str) -> float:
    """Returns the plan's duration in s, less half a control period."""
    return plan_of(plan).duration_s - 0.5 * default_profile().dt


def on_the_firmware(case: tuple[str, str, float, int]) -> Frozen:
    plan, axis, at_s, _ = case
    words = {"step": ["run-step", "--roll", "10", "--yaw", "20"]}.get(plan, ["run", plan])
    with tempfile.TemporaryDirectory() as folder:
        profile = write_profile(Path(folder) / "rig.toml", rate_hz=200, **PATIENT)
        with firmware_rig("--freeze-encoder", f"{axis}@{at_s:g}") as rig_process:
            done = subprocess.run(
                [
                    sys.executable, "-m", "heli3dof", *words, "--json", "--device",
                    rig_process.url("watchdog_s=0.9"), "--profile", str(profile),
                    "-o", str(Path(folder) / "f.mcap"),
                ],
                capture_output=True, text=True,
            )  # fmt: skip
    document = json.loads(done.stdout) if done.stdout.strip() else {}
    ending = str(document.get("outcome", f"exit {done.returncode}"))
    warned = any(f"The {axis} encoder's count" in text for text in document.get("warnings", []))
    return Frozen(plan, axis, at_s, ending, done.stderr[-300:], None, False, warned)


def measure() -> list[Figure]:
    # Build first: a pool's processes, forked during the build, would keep its lock for ever.
    rig_program()
    # The firmware flies in real time, with priority over the flights on the virtual clock.
    with (
        ProcessPoolExecutor(WORKERS, initializer=os.nice, initargs=(10,)) as pool,
        ThreadPoolExecutor(3 * WORKERS) as threads,
    ):
        on_firmware = threads.map(on_the_firmware, cases(15))
        mock = list(pool.map(on_the_mock, cases(14)))
        calm = pool.map(calm_flight, range(1, 1 + max(1, round(HOURS * 3600 / CALM_S))))
        rich = pool.map(rich_flight, range(1, 1 + max(1, round(HOURS * 60))))
        wrong_calm, wrong_rich = _wrong(calm), _wrong(rich)
        firmware = list(on_firmware)
    moving = [f.found_s for f in mock if f.moving and f.found_s is not None]
    moving_landing = sum(f.moving and f.found_s is None for f in mock)
    return [
        *(_completed("the emulated rig", mock)),
        *(_completed("the firmware", firmware)),
        at_most(
            "frozen in motion: time to detection, median", statistics.median(moving), 0.5, "s",
            how=f"{len(moving)} flights of the emulated rig",
        ),
        at_most("frozen in motion: time to detection, longest", max(moving), 2.0, "s"),
        Figure("frozen in motion: detected only in the ramp to zero", str(moving_landing)),
        at_most(f"false trips in {HOURS:g} h, calm flights", len(wrong_calm), 0, "",
                how="; ".join(wrong_calm)),
        at_most(f"false trips in {HOURS:g} h, rich flights", len(wrong_rich), 0, "",
                how="; ".join(wrong_rich)),
    ]  # fmt: skip


def _completed(where: str, flights: list[Frozen]) -> list[Figure]:
    missed = [f for f in flights if f.ending == "completed"]
    which = ", ".join(f"{f.plan} {f.axis} at {f.at_s:g} s" for f in missed)
    other = [f for f in flights if f.ending not in ("completed", "tripped")]
    rows = [
        at_most(
            f"{where}: flights with a frozen encoder that end as completed", len(missed), 0, "",
            how=f"of {len(flights)}" + (f": {which}" if which else ""),
        ),
        at_most(
            f"{where}: … and whose summary does not warn of that encoder",
            sum(not f.warned for f in missed), 0, "",
        ),
    ]  # fmt: skip
    if other:
        ends = ", ".join(sorted({f.ending for f in other}))
        rows.append(Figure(f"{where}: flights with another outcome", str(len(other)), how=ends))
    return rows


def calm_flight(seed: int) -> str | None:
    """Returns the cause of a false trip in hover, or None."""
    outcome = hover(CALM_S, seed, "&spread=0.15")
    return None if outcome.ending == "completed" else f"seed {seed}: {outcome.detail}"


def rich_flight(seed: int) -> str | None:
    """Returns the cause of a false trip in a flight of the plan ``rich``, or None."""
    profile = default_profile().with_controller()
    url = f"mock:?speed=max&seed={20_000 + seed}&spread=0.15&noise={NOISE[seed % 3]:g}"
    outcome = flown(load_plan("rich"), url, profile, Course())
    return None if outcome.ending == "completed" else f"seed {seed}: {outcome.detail}"


def _wrong(flights: Iterable[str | None]) -> list[str]:
    return [each for each in flights if each is not None]
