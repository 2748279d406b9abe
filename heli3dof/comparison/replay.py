"""Closed-loop replay: the same references, extra voltages and controller, on a model.

    V[k] = V_o + K_g (x_ref − x)[k] + V_extra[k],   clipped to ±v_max            (7), E5, E6

The model starts at rest at the flight's first angles, and is told nothing of what the rig did
afterwards. That is the only fair replay of this plant: it integrates twice, so a voltage replayed
open loop drifts (0.05 V of bias is 25° after 10 s), while the loop holds model and rig to the
same references. It needs the controller, so a recording whose loop is unknown is not replayed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from heli3dof.axes import AXES, PITCH, ROLL, YAW
from heli3dof.model.base import LoopTask, Model
from heli3dof.recording.recording import Recording
from heli3dof.recording.row import CLOSED_LOOP

DIVERGED_DEG = {ROLL: 180.0, PITCH: 180.0, YAW: 720.0}
"""A model this far from its reference has left every rig: it diverges."""


@dataclass(frozen=True, eq=False)
class Replay:
    """A model's flight at the recording's own instants."""

    t: np.ndarray
    """(N,) s"""
    angle: np.ndarray
    """(N, 3) rad, NaN from the moment it diverges."""
    voltage: np.ndarray
    """(N, 2) V after the limiter, NaN likewise."""
    diverged_at_s: float | None
    """s on the recording's clock, or None."""
    unstable_poles: tuple[complex, ...]
    """rad/s: the model's poles in this loop that do not decay."""


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
    grid = _grid(t, profile.dt)
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


def replay(model: Model, recording: Recording) -> Replay:
    """Fly the model through the recording's task. Raises ValueError where the loop is unknown."""
    flown = under_control(recording)
    task = loop_task(flown)
    with np.errstate(over="ignore", invalid="ignore"):
        result = model.fly(task)
        away = np.abs(np.degrees(result.angle - np.nan_to_num(task.reference)))
    limit = np.array([DIVERGED_DEG[i] for i in range(len(AXES))])
    lost = ~np.isfinite(result.angle).all(axis=1) | ~(away <= limit).all(axis=1)
    grid = flown.t[0] + task.dt * np.arange(len(lost))
    angle = np.column_stack([np.interp(flown.t, grid, a) for a in result.angle.T])
    voltage = np.column_stack([np.interp(flown.t, grid, v) for v in result.voltage.T])
    diverged_at_s = None
    if lost.any():
        diverged_at_s = float(grid[int(np.argmax(lost))])
        gone = flown.t >= diverged_at_s - task.dt
        angle[gone], voltage[gone] = np.nan, np.nan
    poles = np.atleast_1d(model.loop_poles(task.controller, task.dt))
    unstable = poles[poles.real > 1e-6]
    order = np.argsort(-unstable.real)
    return Replay(
        flown.t, angle, voltage, diverged_at_s, tuple(complex(p) for p in unstable[order])
    )


def _grid(t: np.ndarray, dt: float) -> np.ndarray:
    """Control instants from the first sample to the last, one period apart."""
    periods = round(float(t[-1] - t[0]) / dt)
    return np.asarray(t[0] + dt * np.arange(periods + 1))
