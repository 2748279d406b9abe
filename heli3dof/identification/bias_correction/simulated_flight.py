"""Simulate a recording's closed-loop flight on a fitted model with its process noise.

The simulation has the recording's references, extra voltages, controller (and its delay, see
`heli3dof.model.control.voltage_replay`), sample times and encoder steps. In each step h (s) it adds
random changes of the rates q̇ and angles q:

    Δq̇ = a √h ξ,     Δq = h/2 Δq̇,     ξ ~ N(0, 1),     a: the fitted noise, rad/s²/√Hz

The flight starts at rest at the recording's first angles. For a decimated log, every control period
is simulated. Sampling jitter is not simulated, nor are mechanical stops other than the table.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from heli3dof.model.compiled import compiled
from heli3dof.model.control.controller import N_OUT
from heli3dof.model.control.simulated_controller import controller_arrays, simulated_law
from heli3dof.model.control.voltage_replay import is_late
from heli3dof.model.estimation.decimated_log import with_loop_rows
from heli3dof.model.greybox.linearisation import balance, true_angles
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.model.physics.integrator import fly_row, readings, setup, stop_at_table
from heli3dof.model.physics.state_layout import FLANK
from heli3dof.model.physics.table import ON_TABLE_BELOW
from heli3dof.recording.recording import Recording


def _fly(  # type: ignore[no-untyped-def]
    s, first, address, par, mem, free, x, F, low, p, c, reference, extra, late, grid0, grid,
    t, h, kick, angle, voltage,
):  # fmt: skip
    """Simulate the closed loop; write the results ``angle`` (N, 3) rad and ``voltage`` (N, 2) V.

    ``kick`` (N, 3): random changes of the rates, rad/s; ``low``: roll on the table, rad;
    ``late``: 1 if the voltage acts one period later, else 0.
    """
    setup(s, first, address, par, mem)
    s[FLANK] = s[FLANK + 1] = s[FLANK + 2] = 2.0
    y, slope, out = np.empty(3), np.empty(3), np.empty(N_OUT)
    w, decay = np.zeros((8, 3)), np.full(3, -1.0)
    N = reference.shape[0]
    target = np.empty((N, 2))
    for k in range(N):
        readings(s, x, first, address, par, mem, y, slope)
        for i in range(3):
            if grid[i] > 0.0:
                y[i] = grid0[i] + np.rint((y[i] - grid0[i]) / grid[i]) * grid[i]
            angle[k, i] = y[i]
        simulated_law(p, c, y, reference[k], extra[k], out)
        if k == 0:
            voltage[0, 0], voltage[0, 1] = out[2], out[3]
        if k + late < N:
            voltage[k + late, 0], voltage[k + late, 1] = out[2], out[3]
        fly_row(s, x, k, t, h, voltage, target, F, first, address, par, mem, free, w, decay)
        for i in range(3):
            x[3 + i] += kick[k, i]
            x[i] += 0.5 * h[k] * kick[k, i]
        stop_at_table(x, low)


_fly_compiled = compiled(_fly, error_model="numpy", nogil=True)


def simulated_flight(
    model: GreyBoxModel, recording: Recording, rng: np.random.Generator, rows: int | None = None
) -> Recording:
    """Return the first ``rows`` rows of the recording, simulated with noise from ``rng``.

    The angles are quantised: they differ from the first recorded ones by whole encoder steps.
    Raises ValueError if the profile has no controller or an axis was not measured.
    """
    profile = recording.profile
    controller = recording.controller
    if controller is None or len(recording.axes) < 3:
        raise ValueError("the controller of this recording is unknown, or an angle is missing")
    n = len(recording) if rows is None else min(rows, len(recording))
    logged = recording.rows(slice(0, n))
    part, at = with_loop_rows(logged)
    n = len(part)
    t = part.t - part.t[0]
    h = np.append(np.diff(t), profile.dt)
    read0 = np.array(part.angle[0])
    grid = np.abs(profile.encoder.rad_per_count)
    hooks = model.structure.hooks
    s, par = model.structure.arrays(model.values)
    on_table = bool(read0[0] < ON_TABLE_BELOW)
    x = np.concatenate([true_angles(model, read0), np.zeros(3)])
    if not on_table:
        x[:3] += rng.uniform(-0.5, 0.5, 3) * grid
    F = np.zeros((max(n, 1), 2))
    if not on_table:
        F[0] = balance(model, x[:3])
    p, c = controller_arrays(controller, profile.motor.V_o, profile.motor.v_max, profile.dt, read0)
    angle, voltage = np.empty((n, 3)), np.empty((n, 2))
    kick = rng.standard_normal((n, 3)) * model.noise * np.sqrt(h)[:, None]
    _fly_compiled(
        s, hooks.first, hooks.address, par, model.structure.memory, np.ones(3, dtype=bool), x, F,
        x[0] if on_table else -np.inf, p, c,
        np.ascontiguousarray(np.nan_to_num(part.reference, nan=0.0)),
        np.ascontiguousarray(np.nan_to_num(part.controller_input, nan=0.0)),
        int(is_late(recording)), read0, grid, t, h, kick, angle, voltage,
    )  # fmt: skip
    return replace(logged, angle=angle[at], voltage=voltage[at])
