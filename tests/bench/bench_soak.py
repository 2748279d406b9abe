"""Half an hour in flight without growth of memory: SOAK_MINUTES in the environment shortens it."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import numpy as np

from tests.bench import Figure, at_most
from tests.drivers.firmware.building import rig_program
from tests.realtime.flight import firmware
from tests.realtime.growth import patient, read_in_flight
from tests.realtime.soak import Soak, found, resident_KiB, soak

TITLE = "A long flight"
INTRO = (
    "`heli3dof run-step` for half an hour, recording to a file and with its live view on, against "
    "the C firmware on a pseudo-terminal: the slope of the resident memory after the warm-up. And "
    "a flight of a million rows on the emulated rig, as fast as it can, recorded to a file."
)
SOAK_MINUTES = float(os.environ.get("SOAK_MINUTES", "30"))
ROWS = int(1e6 * min(1.0, SOAK_MINUTES / 30))
SLACK = ("--watchdog", "500")
"""A machine with other work may stand still for longer than the firmware's own 100 ms."""
GROWTH_KiB_PER_MIN = 50.0
"""3 MiB in an hour"""


def measure() -> list[Figure]:
    figures = [rows()]
    with tempfile.TemporaryDirectory() as folder, firmware(rig_program(), *SLACK) as device:
        figures += steady(soak(device, Path(folder), SOAK_MINUTES * 60))
    return figures


def rows() -> Figure:
    """The emulated flight: resident memory by the minutes that its rows would have taken."""
    at = [round(k) for k in np.linspace(ROWS / 100, ROWS - 1, 100)]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rows.mcap"
        held, _ = read_in_flight(path, ROWS, at, lambda: resident_KiB(os.getpid()))
        written_MB = path.stat().st_size / 1e6
    grown = found(np.array(at) * patient().dt, np.array(held), {})
    how = (
        f"{ROWS} rows, {written_MB:.0f} MB written; {grown.minutes:.0f} min of flight; "
        f"{said(grown)}"
    )
    return at_most(
        "soak: a flight on the emulated rig grows by", grown.slope_KiB_per_min,
        GROWTH_KiB_PER_MIN, "KiB per minute of flight", how=how,
    )  # fmt: skip


def steady(long: Soak) -> list[Figure]:
    """The soak: the slope's interval, and what the flight itself says."""
    flight = long.flight
    how = (
        f"{long.minutes:.1f} min, {said(long)}; {flight['periods']} periods, "
        f"{flight['missed_periods']} missed, {flight['lost_periods']} lost"
    )
    return [
        at_most(
            "soak: memory grows by", long.slope_KiB_per_min, GROWTH_KiB_PER_MIN, "KiB/min", how=how
        ),
    ]


def said(of: Soak) -> str:
    """Where it began and ended, and the slope's interval."""
    return (
        f"{of.first_MiB:.1f} to {of.last_MiB:.1f} MiB resident; "
        f"95 % interval {of.low:.1f} to {of.high:.1f}"
    )
