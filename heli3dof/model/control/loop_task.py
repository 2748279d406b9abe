"""The loop that flew a recording, as a task for a model: references, extra voltages, controller.

Only a recording whose controller is known, with references and all three angles, can be flown
again; `why_not_replayed` says why another cannot.
"""

from __future__ import annotations

import numpy as np

from heli3dof.axes import AXES
from heli3dof.model.base import LoopTask
from heli3dof.recording.recording import Recording
from heli3dof.recording.row import CLOSED_LOOP


def why_not_replayed(recording: Recording) -> str | None:
    """Why the loop of a recording cannot be replayed; None when it can."""
    if recording.profile.controller is None:
        return (
            "the loop is unknown: the profile has no [controller], so nothing may depend on "
            "replaying it"
        )
    if not any(recording.has_reference(axis) for axis in AXES):
        return "no reference was recorded, so there is nothing to replay"
    if missing := [axis for axis in AXES if axis not in recording.axes]:
        return f"the {' and '.join(missing)} angle was not recorded, so the start is unknown"
    return None


def loop_task(recording: Recording) -> LoopTask:
    """What the recorded flight was asked to do, at the profile's exact control period.

    Give it the rows under control only (`under_control`).

    A recording with lost samples is filled with the last reference and extra voltage, as the
    controller would have held them. Raises ValueError for a recording that `why_not_replayed`.
    """
    if why := why_not_replayed(recording):
        raise ValueError(why)
    profile, t = recording.profile, recording.t
    grid = instants(t, profile.dt)
    # Half a period of slack: a sample that came late still belongs to its own period.
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
    """The part that a controller flew: without the ramp to zero volts that ends a flight.

    Recordings of ours say so in their ``phase``; of others, what has no reference at either end
    is left out, where there is a reference at all.
    """
    if "phase" in recording.channels:
        flown = recording.channels["phase"] == CLOSED_LOOP
    else:
        flown = ~np.isnan(recording.reference).all(axis=1)
    rows = np.flatnonzero(flown)
    if not len(rows):
        return recording
    return recording.rows(slice(int(rows[0]), int(rows[-1]) + 1))


def instants(t: np.ndarray, dt: float) -> np.ndarray:
    """Control instants from the first sample to the last, one period apart."""
    periods = round(float(t[-1] - t[0]) / dt)
    return np.asarray(t[0] + dt * np.arange(periods + 1))
