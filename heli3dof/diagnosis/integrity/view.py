"""A recording as the checks look at it: what several of them need is computed once."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from heli3dof.axes import AXES, ROLL
from heli3dof.diagnosis.integrity.response import Response, responses
from heli3dof.identification.row_selection import clipped, unusable
from heli3dof.recording.logs.sampling_clock import Ticks, ticks
from heli3dof.recording.recording import Recording

GROUNDED = ("unread", "table", "stop", "motors_off", "falling", "ramp_down")


class View:
    """Lazy quantities of one recording; N samples."""

    def __init__(self, recording: Recording) -> None:
        self.recording = _finite(recording)

    @cached_property
    def measured(self) -> list[int]:
        """Indices of the axes that were measured."""
        return [i for i, a in enumerate(AXES) if a in self.recording.axes]

    @cached_property
    def read(self) -> np.ndarray:
        """(N,) bool: voltage and every measured angle are numbers."""
        r = self.recording
        return np.asarray(
            np.isfinite(r.voltage).all(axis=1) & np.isfinite(r.angle[:, self.measured]).all(axis=1)
        )

    @cached_property
    def ticks(self) -> Ticks:
        return ticks(self.recording.t)

    @cached_property
    def why_not(self) -> dict[str, np.ndarray]:
        """(N,) bool by reason; see `heli3dof.identification.row_selection`."""
        return unusable(self.recording)

    @cached_property
    def airborne(self) -> np.ndarray:
        """(N,) bool: free to move, take-off included; nothing but thrust and gravity acts."""
        return np.asarray(~np.logical_or.reduce([self.why_not[k] for k in GROUNDED]))

    @cached_property
    def flying(self) -> np.ndarray:
        """(N,) bool: airborne, and take-off is over."""
        return np.asarray(self.airborne & ~self.why_not["take_off"])

    @cached_property
    def clipped(self) -> np.ndarray:
        """(N,) bool: a voltage at the amplifier's limit."""
        return clipped(self.recording)

    @cached_property
    def hover_ratio(self) -> float | None:
        """h, the mean voltage in flight over the one that T_g = 2 L_a K_f V_o asks for.

        L_a cos p K_f S = T_g cos r in the mean of a long flight, so h = ⟨S cos p / cos r⟩ / 2 V_o.
        None where roll was not measured or there is no flight of 2 s.
        """
        r, rows = self.recording, self.flying
        V_o = r.profile.motor.V_o
        if ROLL not in self.measured or rows.sum() * r.dt < 2.0 or V_o == 0:
            return None
        roll, pitch = r.angle[rows, 0], np.nan_to_num(r.angle[rows, 1])
        S = r.voltage[rows].sum(axis=1)
        return float(np.mean(S * np.cos(pitch) / np.cos(roll)) / (2 * V_o))

    @cached_property
    def responses(self) -> dict[str, Response]:
        """Axis → how it answers the voltages, where it was measured and driven."""
        return responses(self.recording, self.airborne, self.ticks.number, self.ticks.period_s)


def _finite(r: Recording) -> Recording:
    """Infinity is no reading either: NaN in its place."""
    if not (np.isinf(r.angle).any() or np.isinf(r.voltage).any()):
        return r
    return replace(
        r,
        angle=np.where(np.isinf(r.angle), np.nan, r.angle),
        voltage=np.where(np.isinf(r.voltage), np.nan, r.voltage),
    )
