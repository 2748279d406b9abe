"""Records the emulated amplifier's output while the command line flies it in this process."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from heli3dof_drivers.mock import MockRig

from heli3dof.errors import SafetyTrip
from heli3dof.recording.mcap_files.reader import read_recording
from heli3dof.recording.recording import Recording
from heli3dof.recording.row import RAMP_DOWN
from heli3dof.rig.drivers import open_driver
from heli3dof.rig.interface import Flags, Sample
from heli3dof.rig.profile import Profile
from tests.cli.running import Result, heli3dof
from tests.safety.table import BY_NAME, STOPPED, Row

SAFETY_TRIP = SafetyTrip.exit_code


class Aboard:
    """Keeps the amplifier's output in every period, and triggers actions at given times."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
        self.volts: list[tuple[float, float, float]] = []
        """Start of a period (s, the device's clock), front and back V during it"""
        self.motion: list[tuple[float, float, float]] = []
        """Start of a period, the arm's true roll (rad) and its rate (rad/s)"""
        self.rig: MockRig | None = None
        self.when_arming: list[Callable[[], Any]] = []
        self._path = folder / "flight.mcap"
        self._to_do: list[tuple[float, Callable[[], Any]]] = []
        monkeypatch.setattr("heli3dof.rig.session.open_exclusive.open_driver", self._open)

    def at(self, t_s: float, what: Callable[[], Any]) -> None:
        """Call ``what`` at the start of the period that begins then."""
        self._to_do.append((t_s, what))

    @property
    def t(self) -> float:
        """s on the device's clock."""
        return self.device.plant.t if self.rig is not None else 0.0

    @property
    def device(self):
        assert self.rig is not None
        return self.rig.device

    def flown(self, device: str, *words: object, roll: str = "3") -> Result:
        """``heli3dof run-step`` on that rig: a hold of 2 s, then a step for 2 s."""
        step = ("--roll", roll, "--settle", "2", "--duration", "2")
        return heli3dof("run-step", *step, "--device", device, "-o", self._path, "--quiet", *words)

    def flown_plan(self, plan: str, device: str) -> Result:
        """``heli3dof run PLAN`` on that rig."""
        return heli3dof("run", plan, "--device", device, "-o", self._path, "--quiet")

    @property
    def recording(self) -> Recording:
        return read_recording(self._path)

    @property
    def ramp_s(self) -> float:
        """Start of the ramp to zero (s, the device's clock)."""
        channels = self.recording.channels
        k = int(np.flatnonzero(channels["phase"] == RAMP_DOWN)[0])
        return float(channels["device_time_s"][k])

    @property
    def zero_s(self) -> float:
        """Time from which the output is zero (s, the device's clock)."""
        ends = [t + self.device.plant.dt for t, *v in self.volts if v != [0.0, 0.0]]
        return ends[-1]

    def shows(self, name: str, result: Result, since_s: float, *, slack_s: float = 0.0) -> None:
        """Assert everything in the table's row, and that the device arms again afterwards."""
        row: Row = BY_NAME[name]
        meta = self.recording.meta
        detail = meta["outcome_details"]["detail"]
        assert result.code == row.exit_code, result.err
        assert meta["outcome"] == row.ending, detail
        assert row.detail in detail
        if row.exit_code == SAFETY_TRIP:
            # In the recording and on the screen, specific to the trip.
            for advice in ("likely_cause", "fix"):
                assert meta["outcome_details"][advice] in result.err
        within_s = row.zero.seconds(self.recording.profile, self.device.watchdog_s)
        assert self.device.v == (0.0, 0.0)
        # Closing the rig takes the volts away too: a stop must have come before that.
        assert self.device.stopped or STOPPED not in row.device
        assert since_s - 1e-9 < self.zero_s <= since_s + within_s + slack_s + 1e-9
        self.arms_again()

    def arms_again(self) -> None:
        """Assert that arming clears every stop."""
        device = self.device
        device.arm()
        device.command(1, 1.0, 2.0)
        device.period()
        assert (device.v, device.flags) == ((1.0, 2.0), Flags.ENABLED)

    def _open(self, url: str, profile: Profile) -> MockRig:
        rig = open_driver(url, profile)
        assert isinstance(rig, MockRig)
        self.rig = rig
        plant: Any = rig.device.plant
        step = plant.step

        def recorded(v_front: float, v_back: float) -> bool:
            while self._to_do and self._to_do[0][0] <= plant.t + 1e-9:
                self._to_do.pop(0)[1]()
            self.volts.append((plant.t, v_front, v_back))
            truth = plant.truth
            self.motion.append((plant.t, truth.angle[0], truth.rate[0]))
            return bool(step(v_front, v_back))

        plant.step = recorded
        arm = rig.arm

        def armed() -> Sample:
            while self.when_arming:
                self.when_arming.pop(0)()
            return arm()

        rig.arm = armed  # type: ignore[method-assign]
        return rig
