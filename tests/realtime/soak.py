"""A long flight, and whether the program's memory grows in it.

The resident set is read from /proc every `EVERY_S`. Its slope is that of a straight line through
the means of `BLOCKS` stretches (single readings hang together), 95 % interval by Student's t.
"""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from tests.profiles import PATIENT, write_profile
from tests.realtime.flight import LANDING_S, FlightProcess

EVERY_S = 0.25
WARM_UP = 0.4
"""Share of the flight at its beginning that is left out: the first of everything takes room, and
the live view's library keeps the last 4096 texts that it measured, ten new ones a second and more,
in a table that it builds anew, beside the old one, whenever that is full of what was dropped."""
BLOCKS = 12
LANDS = b"ramping down"
"""What the live view says once the flight is over: then the recording is read back"""


@dataclass(frozen=True)
class Soak:
    """What a long flight took."""

    minutes: float
    """Of readings, without the warm-up"""
    flown_min: float
    """Of readings in all"""
    first_MiB: float
    last_MiB: float
    slope_KiB_per_min: float
    low: float
    """of the slope's 95 % interval"""
    high: float
    flight: dict[str, Any]
    """The flight's own JSON document"""


def soak(device: str, folder: Path, seconds: float) -> Soak:
    """Fly for ``seconds`` with recorder and live view, and read the memory meanwhile.

    A flight that is cut short is told for as long as it was: its document says why.
    """
    profile = write_profile(folder / "soak.toml", duration_max_s=seconds + 60, **PATIENT)
    t: list[float] = []
    resident: list[float] = []
    with FlightProcess(device, folder / "soak.mcap", seconds, profile=profile) as flight:
        while b"flying" not in flight.shown and flight.process.poll() is None:
            time.sleep(0.05)
        start = time.monotonic()
        while (now := time.monotonic() - start) < seconds - 1 and LANDS not in flight.shown:
            if flight.process.poll() is not None:
                break
            t.append(now)
            resident.append(resident_KiB(flight.process.pid))
            time.sleep(EVERY_S)
        document = flight.ended(seconds + LANDING_S + 120)
    return found(np.array(t), np.array(resident), document)


def found(t_s: np.ndarray, resident_KiB: np.ndarray, document: dict[str, Any]) -> Soak:
    """The slope of readings (N,), KiB at s, without the warm-up."""
    keep = t_s >= WARM_UP * t_s[-1]
    minutes, kept = t_s[keep] / 60, resident_KiB[keep]
    blocks = np.array_split(np.arange(len(kept)), BLOCKS)
    line = stats.linregress([minutes[b].mean() for b in blocks], [kept[b].mean() for b in blocks])
    half = float(stats.t.ppf(0.975, BLOCKS - 2)) * float(line.stderr)
    slope = float(line.slope)
    return Soak(
        float(minutes[-1] - minutes[0]), float(t_s[-1]) / 60,
        float(kept[0]) / 1024, float(kept[-1]) / 1024,
        slope, slope - half, slope + half, document,
    )  # fmt: skip


def resident_KiB(pid: int) -> float:
    """A process's resident set."""
    pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGESIZE") / 1024
