"""`View`: quantities of a recording that several checks need, each computed once."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from heli3dof.axes import AXES, ROLL
from heli3dof.identification.row_selection import clipped, unusable
from heli3dof.integrity.response import Response, responses
from heli3dof.recording.logs.corrections import corrected
from heli3dof.recording.logs.held_angles import held_axes
from heli3dof.recording.logs.sampling_clock import SamplingClock, estimate_clock
from heli3dof.recording.recording import Recording

GROUNDED = ("unread", "table", "stop", "motors_off", "falling", "ramp_down")
"""Reasons of `row_selection` for which a row is not airborne"""


class View:
    """Quantities of one recording of N samples, computed on first use; NaN replaces infinities."""

    def __init__(self, recording: Recording) -> None:
        r = recording
        if np.isinf(r.angle).any() or np.isinf(r.voltage).any():
            angle, voltage = (np.where(np.isinf(x), np.nan, x) for x in (r.angle, r.voltage))
            r = replace(r, angle=angle, voltage=voltage)
        self.recording = r

    @cached_property
    def measured(self) -> list[int]:
        """Return the indices of the measured axes."""
        return [i for i, a in enumerate(AXES) if a in self.recording.axes]

    @cached_property
    def finite_rows(self) -> np.ndarray:
        """Return (N,) bool: rows with finite voltages and finite measured angles."""
        r = self.recording
        return np.asarray(
            np.isfinite(r.voltage).all(axis=1) & np.isfinite(r.angle[:, self.measured]).all(axis=1)
        )

    @cached_property
    def corrected(self) -> Recording:
        """Return the recording with estimated sampling times and with voltages limited to ±v_max.

        v_max is the amplifier's limit in the profile. The estimate of the times is explained in
        `heli3dof.recording.logs.sampling_clock`.
        """
        return corrected(self.recording)

    @cached_property
    def sampling_clock(self) -> SamplingClock:
        return estimate_clock(self.recording.t)

    @cached_property
    def held_axes(self) -> dict[str, float]:
        """Return {axis: m} for each axis whose encoder readings the log repeats in m > 1 rows."""
        return held_axes(self.recording.angle, self.recording.profile.encoder.rad_per_count)

    @cached_property
    def unusable(self) -> dict[str, np.ndarray]:
        """Return {reason: (N,) bool}: the rows that `row_selection` excludes from a fit."""
        return unusable(self.recording)

    @cached_property
    def airborne(self) -> np.ndarray:
        """Return (N,) bool: rows with motors on, arm off the table, and no axis at its stop.

        Rows of the take-off, after lift-off, are included.
        """
        return np.asarray(~np.logical_or.reduce([self.unusable[k] for k in GROUNDED]))

    @cached_property
    def flying(self) -> np.ndarray:
        """Return (N,) bool: airborne rows after take-off."""
        return np.asarray(self.airborne & ~self.unusable["take_off"])

    @cached_property
    def clipped(self) -> np.ndarray:
        """Return (N,) bool: rows with a voltage at the amplifier's limit."""
        return clipped(self.recording)

    @cached_property
    def hover_ratio(self) -> float | None:
        """Return the ratio h of the hover voltage in flight to the profile's V_o.

        h = mean(S cos p / cos r) / (2 V_o), with roll r, pitch p and the voltage sum S = V_f + V_b.
        Returns None if roll was not measured, V_o is zero or the flight is shorter than 2 s.
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
        """Return {axis: its response g to the voltages}, with each g as a `Response`.

        g is the acceleration that the voltages cause, divided by the profile's prediction. Axes
        that were not measured, or that no voltage drives, are left out.
        """
        return self.responses_to(self.recording)

    def responses_to(self, recording: Recording) -> dict[str, Response]:
        """Return {axis: its response g to the voltages of ``recording``}, as `responses` does.

        ``recording`` is a copy of the view's recording with other voltages.
        """
        clock = self.sampling_clock
        return responses(recording, self.airborne, clock.number, clock.period_s)
