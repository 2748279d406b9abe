"""Simulate a model in closed loop with a flight's references, excitation and controller (replay).

    V[k] = V_o + K_g (x_ref − x)[k] + V_extra[k],   clipped to ±v_max

This is eq (7) of the paper, with errata E5 and E6 corrected. V_o is the hover voltage, K_g the
controller's gain matrix, x the state, x_ref its reference, V_extra the flight's excitation, v_max
the voltage limit. The model starts at rest at the flight's initial angles; later angles are not
used. An open-loop simulation would drift, because the plant integrates twice: 0.05 V of bias gives
25° after 10 s. In closed loop, model and rig follow the same references. If a linear controller was
identified from the log (`heli3dof.recording.linear_controller`), it replaces eq (7).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from heli3dof.axes import AXES, PITCH, ROLL, YAW
from heli3dof.model.base import Model
from heli3dof.model.control.loop_task import (
    control_instants,
    loop_task,
    under_control,
)
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import ControllerSpec

DIVERGED_DEG = {ROLL: 180.0, PITCH: 180.0, YAW: 720.0}
"""Axis → degrees: a model further than this from its reference has diverged (a convention)."""


@dataclass(frozen=True, eq=False)
class Replay:
    """A model's closed-loop simulation with a recording's references, at the recording's times."""

    t: np.ndarray
    """(N,) s: the recording's times"""
    angle: np.ndarray
    """(N, 3) rad: the simulated angles; NaN once the model has diverged"""
    diverged_at_s: float | None
    """s on the recording's clock when the model diverged; None if it did not"""
    unstable_poles: tuple[complex, ...]
    """rad/s: the poles of the linear closed loop that are in the right half plane; none are
    computed for a controller identified from the log"""


def replay(model: Model, recording: Recording) -> Replay:
    """Return a model's closed-loop simulation with a recording's controller and references.

    Raises ValueError if the recording lacks its controller, references or initial angles
    (`heli3dof.model.control.loop_task.why_not_replayed`).
    """
    flown = under_control(recording)
    task = loop_task(flown)
    with np.errstate(over="ignore", invalid="ignore"):
        result = model.fly(task)
        away = np.abs(np.degrees(result.angle - np.nan_to_num(task.reference)))
    limit = np.array([DIVERGED_DEG[i] for i in range(len(AXES))])
    lost = ~np.isfinite(result.angle).all(axis=1) | ~(away <= limit).all(axis=1)
    grid = control_instants(flown.t, task.dt)
    angle = np.column_stack([np.interp(flown.t, grid, a) for a in result.angle.T])
    diverged_at_s = None
    if lost.any():
        diverged_at_s = float(grid[int(np.argmax(lost))])
        angle[flown.t >= diverged_at_s - task.dt] = np.nan
    poles = np.empty(0, dtype=complex)
    if isinstance(task.controller, ControllerSpec):
        poles = np.atleast_1d(model.loop_poles(task.controller, task.dt))
    unstable = poles[poles.real > 1e-6]
    order = np.argsort(-unstable.real)
    return Replay(flown.t, angle, diverged_at_s, tuple(complex(p) for p in unstable[order]))
