"""Half an hour in flight without growth of memory: SOAK_MINUTES in the environment shortens it."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from tests.bench import Figure, at_most
from tests.drivers.firmware.building import rig_program
from tests.realtime.flight import firmware
from tests.realtime.soak import Soak, soak

TITLE = "A long flight"
INTRO = (
    "`heli3dof run-step` for half an hour, recording to a file and with its live view on, against "
    "the C firmware on a pseudo-terminal: the slope of the resident memory after the warm-up."
)
SOAK_MINUTES = float(os.environ.get("SOAK_MINUTES", "30"))
SLACK = ("--watchdog", "500")
"""A machine with other work may stand still for longer than the firmware's own 100 ms."""
GROWTH_KiB_PER_MIN = 50.0
"""3 MiB in an hour"""


def measure() -> list[Figure]:
    with tempfile.TemporaryDirectory() as folder, firmware(rig_program(), *SLACK) as device:
        return steady(soak(device, Path(folder), SOAK_MINUTES * 60))


def steady(long: Soak) -> list[Figure]:
    """The soak: the slope's interval, and what the flight itself says."""
    how = (
        f"{long.minutes:.1f} min, {long.first_MiB:.0f} to {long.last_MiB:.0f} MiB resident; "
        f"95 % interval {long.low:.1f} to {long.high:.1f}"
    )
    return [
        at_most(
            "soak: memory grows by", long.slope_KiB_per_min, GROWTH_KiB_PER_MIN, "KiB/min", how=how
        ),
    ]
