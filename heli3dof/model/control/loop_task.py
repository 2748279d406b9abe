"""The closed-loop task of a recording: its references, extra voltages and controller.

A replay needs a known controller, references and all three angles; `why_not_replayed` states which
of them a recording lacks.
"""

from __future__ import annotations

import numpy as np

from heli3dof.axes import AXES
from heli3dof.model.base import LoopTask
from heli3dof.recording.recording import Recording
from heli3dof.recording.row import CLOSED_LOOP


def why_not_replayed(recording: Recording) -> str | None:
    """The reason why the loop of a recording cannot be replayed; None if it can."""
    if recording.profile.controller is None:
        return (
            "the controller is unknown: the profile has no [controller], so nothing may depend on "
            "replaying it"
        )
    if not any(recording.has_reference(axis) for axis in AXES):
        return "no reference was recorded, so there is nothing to replay"
    if missing := [axis for axis in AXES if axis not in recording.axes]:
        return f"the {' and '.join(missing)} angle was not recorded, so the start is unknown"
    return None


def loop_task(recording: Recording) -> LoopTask:
    """Return the recorded flight's task at the profile's exact control period.

    The recording must hold rows under control only (`under_control`). Lost samples get the last
    reference and extra voltage. Raises ValueError if `why_not_replayed` gives a reason.
    """
    if reason := why_not_replayed(recording):
        raise ValueError(reason)
    profile, t = recording.profile, recording.t
    grid = control_instants(t, profile.dt)
    # Half a period of tolerance: a late sample belongs to its own period.
    held = np.searchsorted(t, grid + 0.5 * profile.dt, side="right") - 1
    assert profile.controller is not None
    return LoopTask(
        reference=recording.reference[held],
        extra=np.nan_to_num(recording.voltage_extra[held]),
        angle0=recording.angle[0],
        controller=profile.controller,
        V_o=profile.motor.V_o,
        v_max=profile.motor.v_max,
        dt=profile.dt,
        rad_per_count=profile.encoder.rad_per_count,
    )


def under_control(recording: Recording) -> Recording:
    """Return the rows in closed loop, without the ramp to zero volts that ends a flight.

    The channel ``phase`` marks them. An imported recording has no such channel; there the rows
    without a reference at either end are dropped, unless no row has one.
    """
    if "phase" in recording.channels:
        flown = recording.channels["phase"] == CLOSED_LOOP
    else:
        flown = ~np.isnan(recording.reference).all(axis=1)
    rows = np.flatnonzero(flown)
    if not len(rows):
        return recording
    return recording.rows(slice(int(rows[0]), int(rows[-1]) + 1))


def control_instants(t: np.ndarray, dt: float) -> np.ndarray:
    """Control instants from the first sample to the last, one period apart."""
    periods = round(float(t[-1] - t[0]) / dt)
    return np.asarray(t[0] + dt * np.arange(periods + 1))
