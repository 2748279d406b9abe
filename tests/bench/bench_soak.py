"""Measures the growth of memory in a flight of half an hour (SOAK_MINUTES in the environment)."""

from __future__ import annotations

import os
import tempfile
import tracemalloc
from pathlib import Path

from tests.bench import Figure, at_least, at_most
from tests.drivers.firmware.building import rig_program
from tests.realtime.flight import firmware
from tests.realtime.growth import read_in_flight
from tests.realtime.soak import Soak, soak

TITLE = "A long flight"
INTRO = (
    "`heli3dof run-step` for half an hour, recording to a file and with its live view on, against "
    "the C firmware on a pseudo-terminal. Measured: private memory of the process "
    "(`smaps_rollup`), after a warm-up of a fifth of the flight. The growth is the mean step from "
    "minute to minute, with a 95 % interval that accounts for the autocorrelation of the steps. "
    "The bar is an upper end of the interval below 1 MiB in 8 hours. In addition, a flight of a "
    "million rows on the emulated rig at full speed, recorded to a file: memory that Python keeps "
    "per row."
)
SOAK_MINUTES = float(os.environ.get("SOAK_MINUTES", "30"))
ROWS = int(1e6 * min(1.0, SOAK_MINUTES / 10))
ASKED_MIN = 30.0
SLACK = ("--watchdog", "1000")
"""Option: a watchdog of 1000 ms, as a busy machine may stall longer than the default of 100 ms"""
GROWTH_KiB_PER_MIN = 1024 / (8 * 60)
"""Bar for the upper end of the interval: 1 MiB in 8 h"""
BYTES_A_ROW = 0.1
"""Bytes of memory kept per row: 0.2 MB per hour at 500 Hz"""


def measure() -> list[Figure]:
    figures = [rows()]
    with tempfile.TemporaryDirectory() as folder, firmware(rig_program(), *SLACK) as device:
        figures += long_flight(soak(device, Path(folder), SOAK_MINUTES * 60))
    return figures


def rows() -> Figure:
    """Measures the growth of Python's memory per row from a third of an emulated flight on."""
    at = (ROWS // 3, ROWS - 1)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rows.mcap"
        try:
            (before, after), _ = read_in_flight(
                path, ROWS, at, lambda: tracemalloc.get_traced_memory()[0], begin=tracemalloc.start
            )
        finally:
            tracemalloc.stop()
        written_MB = path.stat().st_size / 1e6
    return at_most(
        "soak: memory kept per row, emulated rig", (after - before) / (at[1] - at[0]),
        BYTES_A_ROW, "B", how=f"{after - before:.0f} B more in row {at[1]} than in row {at[0]}; "
        f"{written_MB:.0f} MB written",
    )  # fmt: skip


def long_flight(long: Soak) -> list[Figure]:
    """Returns the figures of the long flight: its duration, and the interval of the growth."""
    flight = long.flight
    ended = (
        f"{flight['detail']}; {flight['periods']} periods, {flight['missed_periods']} missed, "
        f"{flight['lost_periods']} lost"
    )
    return [
        # The readings of memory end a second before the flight does.
        at_least(
            "soak: duration of the flight", round(long.flown_min, 1), ASKED_MIN, "min", how=ended
        ),
        at_most(
            "soak: growth of memory, upper limit of the 95 % interval", long.high,
            GROWTH_KiB_PER_MIN, "KiB/min",
            how=f"the last {long.minutes:.1f} min, {memory_text(long)}",
        ),
    ]  # fmt: skip


def memory_text(of: Soak) -> str:
    """Returns as text the first and last reading and the interval of the growth."""
    files = "{:.1f} to {:.1f}".format(*of.files_MiB)
    return (
        f"{of.first_MiB:.2f} to {of.last_MiB:.2f} MiB private, {files} MiB of files; mean step "
        f"{of.growth_KiB_per_min:.2f} KiB/min, 95 % interval {of.low:.2f} to {of.high:.2f}"
    )
