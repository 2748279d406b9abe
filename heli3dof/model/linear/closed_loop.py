"""Simulate the closed loop of the sampled controller with a `LinearModel` (compiled).

In control period k, with the trim u0 (V), y0 (rad) and the model's state x::

    y[k] = C x[k] + y0
    v[k] = clip(law(y[k], ref[k], extra[k]), ±v_max)
    x[k+1] = A x[k] + B (v[k] − u0)

y (rad) are the angles, ref their references. extra (V) are voltages that the experiment adds to the
controller's. The control law is `heli3dof.model.control.simulated_controller.simulated_law`. If the
simulated rig has encoders with finite steps, the law gets y[k] rounded to these steps.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from heli3dof.model.base import LoopResult, LoopTask
from heli3dof.model.compiled import compiled
from heli3dof.model.control.controller import N_OUT, after_law, before_law, open_loop_arguments
from heli3dof.model.control.simulated_controller import controller_arrays, simulated_law
from heli3dof.model.linear.initial_state import rest_state

if TYPE_CHECKING:
    from heli3dof.model.linear.model import LinearModel

_before, _after = compiled(before_law), compiled(after_law)


@compiled
def _fly(  # type: ignore[no-untyped-def]
    A, B, C, u0, y0, x, p, s, opened, bounds, z, reference, extra, grid0, grid, angle, voltage, cmd,
):  # fmt: skip
    n = A.shape[0]
    y = np.empty(3)
    out = np.empty(N_OUT)
    x_next = np.empty(n)
    for k in range(reference.shape[0]):
        for i in range(3):
            acc = y0[i]
            for j in range(n):
                acc += C[i, j] * x[j]
            angle[k, i] = acc
            if grid[i] > 0.0:
                acc = grid0[i] + np.rint((acc - grid0[i]) / grid[i]) * grid[i]
            y[i] = acc
        if opened.shape[0] > 0:
            _before(p, s, bounds, z, opened[k], y, reference[k], extra[k])
        simulated_law(p, s, y, reference[k], extra[k], out)
        if opened.shape[0] > 0:
            _after(p, s, z, opened[k], extra[k], out)
        u_f = out[2] - u0[0]
        u_b = out[3] - u0[1]
        for i in range(2):
            cmd[k, i] = out[i]
            voltage[k, i] = out[2 + i]
        for i in range(n):
            acc = B[i, 0] * u_f + B[i, 1] * u_b
            for j in range(n):
                acc += A[i, j] * x[j]
            x_next[i] = acc
        for i in range(n):
            x[i] = x_next[i]


def fly(model: LinearModel, task: LoopTask) -> LoopResult:
    """Return the closed-loop flight that ``task`` describes, simulated from rest at ``angle0``.

    The start need not be an equilibrium, because the model omits the table on which a real rig
    rests. Quantised readings are angle0 plus whole encoder steps. A diverging loop gives inf and
    NaN. An axis that is not modelled is NaN in the result, and the controller reads angle0 for it.
    Raises RecordingError if ``task.dt`` does not suit the model (`LinearModel.at`).
    """
    model = model.at(task.dt)
    N = len(task.reference)
    angle0 = np.where(np.isfinite(task.angle0), task.angle0, model.y0).astype(float)
    there = model.modelled
    C = np.where(there[:, None], model.C, 0.0)
    grid = np.zeros(3) if task.rad_per_count is None else np.abs(task.rad_per_count)
    p, s = controller_arrays(task.controller, task.V_o, task.v_max, task.dt, angle0)
    angle, voltage, cmd = np.empty((N, 3)), np.empty((N, 2)), np.empty((N, 2))
    reference = np.nan_to_num(_floats(task.reference), nan=0.0)
    extra = np.nan_to_num(_floats(task.extra), nan=0.0)
    _fly(
        *map(_floats, (model.A, model.B, C, model.u0)),
        np.where(there, model.y0, angle0).astype(float), _floats(rest_state(model, angle0)).copy(),
        p, s, *open_loop_arguments(task), reference, extra, angle0, _floats(grid), angle, voltage,
        cmd,
    )  # fmt: skip
    angle[:, ~there] = np.nan
    return LoopResult(
        t=task.dt * np.arange(N, dtype=float),
        angle=angle,
        voltage=voltage,
        voltage_cmd=cmd,
        reference=None if task.opened is None else reference,
        extra=None if task.opened is None else extra,
    )


def _floats(a: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(a, dtype=float)
