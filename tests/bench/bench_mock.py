"""How fast the emulated rig runs."""

from __future__ import annotations

import statistics
import time

from heli3dof.rig.drivers import open_rig
from heli3dof.rig.port import Command
from heli3dof.rig.profile import default_profile
from tests.bench import Figure, at_least

TITLE = "The mock rig"
INTRO = "Exchanges through the port at `speed=max`, 500 Hz, one thread; no controller, no recorder."
SECONDS = 40.0


def times_real_time(hide: str) -> float:
    profile = default_profile()
    rig = open_rig(f"mock:?speed=max&start=level&hide={hide}", profile)
    rig.arm()
    n = round(SECONDS / profile.dt)
    start = time.perf_counter()
    for k in range(n):
        rig.exchange(Command(k + 1, 7.456, 7.456), 0.0)
    return SECONDS / (time.perf_counter() - start)


def measure() -> list[Figure]:
    figures = []
    for what, hide in (
        ("nothing hidden", ""),
        ("three effects hidden", "friction.coulomb.yaw:0.03,motor.lag:0.1,motor.dead_zone:1"),
    ):
        speeds = [times_real_time(hide) for _ in range(5)]
        how = f"median of 5 × {SECONDS:g} s, {min(speeds):.0f} to {max(speeds):.0f}"
        figures.append(
            at_least(f"mock, {what}", statistics.median(speeds), 200, "× real time", how=how)
        )
    return figures
