"""Convert a recording to the input of a closed-loop simulation (a task), to replay the flight.

A replay needs references, all three angles and a controller: the profile's, or one identified from
the log (`voltage_replay.with_known_controller`). `why_not_replayed` states what a recording lacks.
"""

from __future__ import annotations

import numpy as np

from heli3dof.axes import AXES
from heli3dof.model.base import LoopTask
from heli3dof.recording.recording import Recording
from heli3dof.recording.row import CLOSED_LOOP


def why_not_replayed(recording: Recording) -> str | None:
    """Return the reason why a closed loop cannot replay the recording, as text; None if it can."""
    if recording.controller is None:
        return "the controller is unknown, because the profile has no [controller]"
    if not any(recording.has_reference(axis) for axis in AXES):
        return "no reference was recorded, so there is nothing to replay"
    if missing := [axis for axis in AXES if axis not in recording.axes]:
        return f"the {' and '.join(missing)} angle was not recorded, so the start is unknown"
    return None


def loop_task(recording: Recording) -> LoopTask:
    """Return the task (the input of a closed-loop simulation) that replays a recorded flight.

    The task has a row for each of the profile's control periods. A row contains the recorded
    references, and the recorded extra voltages, which the experiment added to the controller's. In
    a period without a sample, both are repeated from the previous row. The task also contains the
    controller and the recorded angles at the start.

    If the controller was identified from the log, it is a linear difference equation for the
    voltages, with an input w (V). Then w, computed from the log, replaces the extra voltages.

    The recording must contain only rows in closed loop (`under_control`). Raises ValueError if the
    flight cannot be replayed (`why_not_replayed`).
    """
    if reason := why_not_replayed(recording):
        raise ValueError(reason)
    profile, t = recording.profile, recording.t
    grid = control_instants(t, profile.dt)
    # A sample up to half a period late counts for its own period.
    held = np.searchsorted(t, grid + 0.5 * profile.dt, side="right") - 1
    assert recording.controller is not None
    return LoopTask(
        reference=recording.reference[held],
        extra=np.nan_to_num(recording.controller_input[held]),
        angle0=recording.angle[0],
        controller=recording.controller,
        V_o=profile.motor.V_o,
        v_max=profile.motor.v_max,
        dt=profile.dt,
        rad_per_count=profile.encoder.rad_per_count,
        start_s=float(recording.elapsed_s[0]),
    )


def under_control(recording: Recording) -> Recording:
    """Return the recording from its first to its last row in closed loop, without the final ramp.

    In the ramp the voltages go to zero. The channel ``phase`` marks the rows in closed loop. In an
    imported recording, which has no such channel, these are the rows with a reference. A recording
    without any such row is returned unchanged.
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
    """Return a controller's sampling instants (s): every ``dt`` s over the span of t (N,) s."""
    periods = round(float(t[-1] - t[0]) / dt)
    return np.asarray(t[0] + dt * np.arange(periods + 1))
