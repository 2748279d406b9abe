"""Simulate a recording's closed-loop flight on a fitted model with its process noise.

The simulation has the recording's references, extra voltages, controller (and its delay, see
`heli3dof.model.control.voltage_replay`), sample times and encoder steps. In each step h (s) it adds
random changes of the rates q̇ and angles q:

    Δq̇ = a √h ξ,     Δq = h/2 Δq̇,     ξ ~ N(0, 1),     a: the fitted noise, rad/s²/√Hz

The flight starts at rest at the recording's first angles. For a decimated log, every control period
is simulated. The simulation has no sampling jitter, and no mechanical stops except the table.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from heli3dof.model.base import LoopTask
from heli3dof.model.control.voltage_replay import is_late
from heli3dof.model.estimation.decimated_log import with_loop_rows
from heli3dof.model.greybox.closed_loop import fly, on_table
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.recording.recording import Recording


def simulated_flight(
    model: GreyBoxModel, recording: Recording, rng: np.random.Generator, rows: int | None = None
) -> Recording:
    """Return the first ``rows`` rows of the recording, simulated with noise from ``rng``.

    ``rows`` = None: all rows. The angles are quantised: they differ from the first recorded ones by
    whole encoder steps. Raises ValueError if the recording lacks an angle or its controller is
    unknown.
    """
    profile = recording.profile
    controller = recording.controller
    if controller is None or len(recording.axes) < 3:
        raise ValueError("the controller of this recording is unknown, or an angle is missing")
    n = len(recording) if rows is None else min(rows, len(recording))
    logged = recording.rows(slice(0, n))
    part, at = with_loop_rows(logged)
    n = len(part)
    t = part.elapsed_s
    h = np.append(np.diff(t), profile.dt)
    read0 = np.array(part.angle[0])
    grid = np.abs(profile.encoder.rad_per_count)
    task = LoopTask(
        part.reference, part.controller_input, read0, controller, profile.motor.V_o,
        profile.motor.v_max, profile.dt, grid,
    )  # fmt: skip
    offset = None if on_table(read0) else rng.uniform(-0.5, 0.5, 3) * grid
    kick = rng.standard_normal((n, 3)) * model.noise * np.sqrt(h)[:, None]
    flown = fly(model, task, t=t, offset=offset, kick=kick, late=is_late(recording))
    angle = read0 + np.rint((flown.angle - read0) / grid) * grid
    return replace(logged, angle=angle[at], voltage=flown.voltage[at])
