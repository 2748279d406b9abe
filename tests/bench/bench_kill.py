"""Measures kill -9 and power cuts: time to zero volts, and how much of the recording is lost.

KILLS in the environment sets the number of flights.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from tests.bench import Figure, at_most
from tests.drivers.firmware.building import rig_program
from tests.realtime.flight import firmware
from tests.realtime.kill import EARLIEST_S, LATEST_S, Killed, kill_flights
from tests.realtime.power import lost_to_a_power_cut

TITLE = "kill -9 and power cuts"
INTRO = (
    "`heli3dof run-step` on the C firmware behind a pseudo-terminal, killed at random moments of "
    "its flight: output of the firmware, contents of the file, and result of `recover`. A power "
    "cut loses the rows that no completed fdatasync covers."
)
KILLS = int(os.environ.get("KILLS", "100"))
SEED = 5
POWER_S = 30.0
WATCHDOG_S, RAMP_S, TURN_S = 0.1, 0.2, 2e-3
"""s: the firmware's watchdog, its ramp, and the tolerance: 1 ms of the watchdog, 1 ms of output"""


def measure() -> list[Figure]:
    program = rig_program()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        log = folder / "device.log"
        with firmware(program, "--log", str(log)) as device:
            killed = list(kill_flights(device, log, folder, KILLS, seed=SEED))
        power = lost_to_a_power_cut(folder / "power.mcap", POWER_S)
    cut = at_most(
        "power cut: data lost at the worst moment", power, 0.5, "s",
        how=f"rows before the last completed fdatasync, {POWER_S:g} s at 500 Hz on this disk",
    )  # fmt: skip
    return [*survived(killed), cut]


def survived(killed: list[Killed]) -> list[Figure]:
    """Returns the figures of the flights ended by kill -9: time to zero volts, and data lost."""
    how = f"{len(killed)} flights, killed {EARLIEST_S:g} to {LATEST_S:g} s after take-off, seed"
    how = f"{how} {SEED}"
    worst = max(k.zero_s for k in killed)
    return [
        at_most(
            "kill -9: last command to zero volts, worst", worst,
            WATCHDOG_S + RAMP_S + TURN_S, "s", how=how,
        ),
        at_most("kill -9: data lost, worst", max(k.lost_s for k in killed), 0.5, "s", how=how),
        Figure(
            "kill -9: files recovered", f"{sum(k.rows > 0 for k in killed)} of {len(killed)}",
            "all", all(k.rows > 0 for k in killed), how,
        ),
    ]  # fmt: skip
