"""Measures what `heli3dof fleet` finds: 1,000 flights of 20 emulated rigs with planted changes.

Each rig flies once a day. Its thrust gain, friction and encoder zero scatter from day to day, as on
a real rig. The seed draws which of them changes, when, and on which day a cable is swapped. Flights
and identifications are kept in bench-out/fleet/SEED, so that a second run only judges them.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from heli3dof.batch.engines import engine
from heli3dof.batch.output_folder import OutputFolder
from heli3dof.batch.run_batch import Batch, run_batch, tasks_of
from heli3dof.batch.sources import find
from heli3dof.batch.task import code_version
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import plan_from_dict
from heli3dof.fleet.analyse import analyse
from heli3dof.fleet.document import fleet_document
from heli3dof.fleet.tracks import read_rows
from heli3dof.rig.profile import default_profile
from tests.bench import Figure
from tests.paths import ROOT

TITLE = "A fleet of rigs"
INTRO = """1,000 flights of 20 emulated rigs, one a day, identified by `batch identify`. Gain,
friction and zero scatter from day to day. The seed draws which of them changes on which rig, and
when."""
SEED = int(os.environ.get("FLEET_SEED", "0"))
"""0: the final table; use 1 and above in development"""
RIGS, FLIGHTS = 20, 50
FOLDER = ROOT / "bench-out" / "fleet"
FIRST_DAY = datetime(2026, 3, 2, 9, 0, tzinfo=UTC)
OPTIONS = {"method": "greybox", "order": None, "terms": "+encoder.offset.pitch"}

GAIN_BETWEEN_RIGS, GAIN_BETWEEN_DAYS = 0.03, 0.003
"""Standard deviations of K_f over nominal"""
FRICTION, FRICTION_BETWEEN_DAYS = 0.03, 0.05
"""N·m·s/rad, viscous friction in yaw, and its relative standard deviation"""
ZERO_BETWEEN_DAYS_DEG = 0.05
GAIN_LOSS, FRICTION_RATIO, ZERO_SHIFT_DEG = 0.08, 2.0, 1.0
"""The planted changes: −8 % of thrust gain, twice the friction, the pitch zero moved by 1°"""
CHANGE_SHARE, SWAP_SHARE = 0.5, 0.25
"""Share of the rigs with each kind of change, and with a swapped cable on one day"""
KINDS = ("gain", "friction", "zero")
PLAN = {
    "name": "check",
    "segment": [
        {"kind": "hold", "duration_s": 6.0},
        {"kind": "multisine", "duration_s": 8.0, "roll_deg": 12.0, "band_Hz": [0.1, 5.0],
         "common_V": 0.7, "difference_V": 0.9},
        {"kind": "multisine", "duration_s": 10.0, "roll_deg": -8.0, "yaw_deg": 40.0,
         "band_Hz": [0.1, 5.0], "common_V": 0.7, "difference_V": 0.9},
    ],
}  # fmt: skip


@dataclass(frozen=True)
class PlantedRig:
    """A rig: kind of change → number of the first flight after it; the flight with the swap."""

    name: str
    gain: float
    changes: Mapping[str, int] = field(default_factory=dict)
    swapped: int | None = None


@dataclass(frozen=True)
class PlantedFlight:
    """One flight: the emulated rig and the day."""

    rig: str
    number: int
    device: str

    @property
    def path(self) -> Path:
        return FOLDER / str(SEED) / "recordings" / f"{self.rig}-{self.number:02d}.mcap"

    @property
    def started_utc(self) -> str:
        return (FIRST_DAY + timedelta(days=self.number)).isoformat(timespec="milliseconds")


def rigs(seed: int) -> list[PlantedRig]:
    """The rigs of a seed. A change leaves at least 8 flights before and after it."""
    rng = np.random.default_rng([20_261_124, seed])
    out = []
    for n in range(RIGS):
        changes = {
            kind: int(rng.integers(8, FLIGHTS - 7)) for kind in KINDS if rng.random() < CHANGE_SHARE
        }
        swapped = int(rng.integers(1, FLIGHTS)) if rng.random() < SWAP_SHARE else None
        gain = float(1 + GAIN_BETWEEN_RIGS * rng.standard_normal())
        out.append(PlantedRig(f"K{n + 1:02d}", gain, changes, swapped))
    return out


def flights(seed: int) -> Iterator[PlantedFlight]:
    """All flights of a seed's rigs."""
    for r, rig in enumerate(rigs(seed)):
        rng = np.random.default_rng([20_261_124, seed, r])
        for k in range(FLIGHTS):
            done = {kind: k >= first for kind, first in rig.changes.items()}
            gain = rig.gain * (1 - GAIN_LOSS * done.get("gain", False))
            gain *= 1 + GAIN_BETWEEN_DAYS * rng.standard_normal()
            friction = FRICTION * (FRICTION_RATIO if done.get("friction") else 1.0)
            friction *= 1 + FRICTION_BETWEEN_DAYS * rng.standard_normal()
            zero = ZERO_SHIFT_DEG * done.get("zero", False)
            zero += ZERO_BETWEEN_DAYS_DEG * rng.standard_normal()
            hidden = (
                f"motor.thrust_gain:{gain:.6f},friction.viscous.yaw:{friction:.6f},"
                f"encoder.offset.pitch:{zero:.6f}"
            )
            fault = "&fault=swapped@0" if k == rig.swapped else ""
            noise = int(rng.integers(2**31))
            yield PlantedFlight(rig.name, k, f"mock:?speed=max&seed={noise}&hide={hidden}{fault}")


def fly(flight: PlantedFlight) -> str:
    """Fly and record, unless the recording exists; returns how the flight ended."""
    if flight.path.exists():
        return "kept"
    profile = default_profile().with_controller().model_copy(update={"name": flight.rig})
    flown = fly_plan(
        plan_from_dict(PLAN), device=flight.device, profile=profile, output=flight.path,
        meta={"started_utc": flight.started_utc},
    )  # fmt: skip
    return flown.outcome.ending


def identified(seed: int) -> Path:
    """The results folder of all flights of a seed; what exists is kept."""
    folder = FOLDER / str(seed)
    (folder / "recordings").mkdir(parents=True, exist_ok=True)
    planted = list(flights(seed))
    with engine() as used:
        for n, (_, ending) in enumerate(used.run(fly, planted), 1):
            if n % 20 == 0:
                print(f"  flown {n}/{len(planted)} ({ending})", file=sys.stderr)
    results = folder / "identified"
    version = folder / "code_version.txt"
    if (results / "results.csv").exists() and version.exists():
        return results
    tasks = list(tasks_of("identify", find([str(folder / "recordings")]), [OPTIONS], None, ""))

    def progress(batch: Batch) -> None:
        if batch.done % 20 == 0:
            print(f"  identified {batch.kept + batch.done}/{batch.total}", file=sys.stderr)

    with OutputFolder(results, resume=True) as out, engine() as used:
        run_batch(tasks, out, used, progress)
    version.write_text(code_version(), encoding="utf-8")
    return results


AFFECTED = {
    "gain": ("thrust_gain_ratio", "hover_voltage_V", "T_g", "J_roll", "J_pitch", "J_yaw"),
    "friction": ("friction.viscous.yaw.damping_Nms_per_rad",),
    "zero": ("encoder.offset.pitch.angle_deg",),
}
"""Kind of change → the quantities that it moves; the first one must be flagged"""
NOT_JUDGED = {
    "gain": ("friction.", "stiffness.", "bias.", "encoder.", "motor."),
    "zero": ("stiffness.pendulum.pitch", "bias.torque.pitch"),
}
"""Beginnings of quantities that a change also moves a little: torques scale with the gain, and the
pitch zero is confounded with two torques. They count neither as found nor as false."""


def measure() -> list[Figure]:
    results = identified(SEED)
    return judged(fleet_document(analyse(read_rows(results))), rigs(SEED))


def judged(document: Mapping[str, Any], planted: Sequence[PlantedRig]) -> list[Figure]:
    """The figures of a fleet document, compared with the planted changes."""
    flagged: dict[tuple[str, str], list[int]] = {}
    for step in document["steps"]:
        number = int(step["after"]["recording"].rpartition("-")[2])
        flagged.setdefault((step["rig"], step["quantity"]), []).append(number)
    other = {(d["rig"], d["quantity"]) for k in ("drifts", "deviating") for d in document[k]}
    found = changes = 0
    false: list[tuple[str, str]] = []
    quiet = 0
    for rig in planted:
        for kind, first in rig.changes.items():
            changes += 1
            numbers = flagged.get((rig.name, AFFECTED[kind][0]), [])
            found += any(abs(n - first) <= 1 for n in numbers)
        moved = [q for kind in rig.changes for q in AFFECTED[kind]]
        unclear = tuple(b for kind in rig.changes for b in NOT_JUDGED.get(kind, ()))
        for quantity in (q["quantity"] for q in document["quantities"]):
            if quantity in moved or quantity.startswith(unclear):
                continue
            quiet += 1
            if (rig.name, quantity) in flagged or (rig.name, quantity) in other:
                false.append((rig.name, quantity))
    swapped = {f"{r.name}-{r.swapped:02d}" for r in planted if r.swapped is not None}
    bad = {Path(b["recording"]).stem for b in document["bad_recordings"]}
    print(f"falsely flagged: {false}; bad data: {sorted(bad)}, swapped: {sorted(swapped)}")
    share, wrong = found / changes, len(false) / quiet
    return [
        Figure("planted changes found with the date ± 1 flight",
               f"{100 * share:.1f} % ({found}/{changes})", "≥ 95 %", share >= 0.95,
               "gain −8 %, friction doubled, zero moved by 1°"),
        Figure("rig-terms without a change that are flagged",
               f"{100 * wrong:.1f} % ({len(false)}/{quiet})", "≤ 1 %", wrong <= 0.01,
               "steps, drifts and deviating flights"),
        Figure("swapped cables listed as bad data", f"{len(swapped & bad)}/{len(swapped)}", "all",
               swapped <= bad, f"{len(bad - swapped)} other flights are listed too"),
    ]  # fmt: skip


if __name__ == "__main__":
    print(json.dumps({"results": str(identified(SEED))}))
