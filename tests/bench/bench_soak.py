"""Half an hour in flight without growth of memory: SOAK_MINUTES in the environment shortens it."""

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
    "the C firmware on a pseudo-terminal: what the program has in memory to itself, as the kernel "
    "counts it (`smaps_rollup`), after a warm-up of a fifth of the flight. Judged is the mean step "
    "from minute to minute, with a 95 % interval that heeds how the steps hang together. *No "
    "growth* means that the interval's upper end stays below 1 MiB in 8 hours: about one per cent "
    "of what the program holds, in a day of flight without a break. And a flight of a million rows "
    "on the emulated rig, as fast as it can, recorded to a file: what Python holds of a row once "
    "it is flown."
)
SOAK_MINUTES = float(os.environ.get("SOAK_MINUTES", "30"))
ROWS = int(1e6 * min(1.0, SOAK_MINUTES / 10))
ASKED_MIN = 30.0
SLACK = ("--watchdog", "1000")
"""A machine with other work may stand still for longer than the firmware's own 100 ms."""
GROWTH_KiB_PER_MIN = 1024 / (8 * 60)
"""What an upper end below counts as none: 1 MiB in 8 h"""
BYTES_A_ROW = 0.1
"""0.2 MB in an hour"""


def measure() -> list[Figure]:
    figures = [rows()]
    with tempfile.TemporaryDirectory() as folder, firmware(rig_program(), *SLACK) as device:
        figures += steady(soak(device, Path(folder), SOAK_MINUTES * 60))
    return figures


def rows() -> Figure:
    """The emulated flight: what Python holds in its last row more than after a third of them."""
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
        "soak: a row on the emulated rig leaves behind", (after - before) / (at[1] - at[0]),
        BYTES_A_ROW, "B", how=f"{after - before:.0f} B more in row {at[1]} than in row {at[0]}; "
        f"{written_MB:.0f} MB written",
    )  # fmt: skip


def steady(long: Soak) -> list[Figure]:
    """The soak: the slope's interval, and what the flight itself says."""
    flight = long.flight
    ended = (
        f"{flight['detail']}; {flight['periods']} periods, {flight['missed_periods']} missed, "
        f"{flight['lost_periods']} lost"
    )
    return [
        # The readings end a second before the flight does.
        at_least("soak: flown for", round(long.flown_min, 1), ASKED_MIN, "min", how=ended),
        at_most(
            "soak: memory grows by, at most", long.high, GROWTH_KiB_PER_MIN, "KiB/min",
            how=f"the last {long.minutes:.1f} min, {memory_text(long)}",
        ),
    ]  # fmt: skip


def memory_text(of: Soak) -> str:
    """Where it began and ended, and the growth's interval."""
    files = "{:.1f} to {:.1f}".format(*of.files_MiB)
    return (
        f"{of.first_MiB:.2f} to {of.last_MiB:.2f} MiB of its own, {files} MiB of files; mean step "
        f"{of.growth_KiB_per_min:.2f} KiB/min, 95 % interval {of.low:.2f} to {of.high:.2f}"
    )
