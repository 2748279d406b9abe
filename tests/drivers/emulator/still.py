"""The golden device: its encoders do not move, and it measures no current."""

from __future__ import annotations

from math import nan
from typing import Any

from heli3dof_drivers.emulator.endpoint import Endpoint


class StillPlant:
    def __init__(self, dt: float = 0.002) -> None:
        self.dt = dt
        self.counts = (0, 0, 0)
        self.t, self.periods = 0.0, 0
        self.volts: list[tuple[float, float]] = []

    def step(self, v_front: float, v_back: float) -> bool:
        self.volts.append((v_front, v_back))
        return True


class StillDevice:
    """The part of `emulator.device.Device` that `Endpoint` uses."""

    def __init__(self, v_max: float = 24.0, watchdog_s: float = 0.1) -> None:
        self.plant = StillPlant()
        self.v_max = v_max
        self.watchdog_s = watchdog_s
        self.held = False
        self.v = (0.0, 0.0)
        self.current = (nan, nan)

    def arm(self) -> None:
        pass


def still_endpoint(**identity: Any) -> Endpoint:
    names = {"model": "golden device", "serial": "G1", "firmware": "1.0", **identity}
    return Endpoint(StillDevice(), **names)  # type: ignore[arg-type]
