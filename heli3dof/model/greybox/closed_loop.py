"""Simulate the closed loop of the sampled controller with a grey-box model (compiled).

The `LoopTask` describes the flight to simulate. Each control period has three steps:

1. The encoders read the angles. If the `LoopTask` gives the encoders' steps, the readings are
   rounded to whole steps.
2. The control law computes the motor voltages.
3. The rig moves for one period with these voltages.

If the initial roll is below `ON_TABLE_BELOW`, the rig starts at rest on the table, with its rotors
at standstill. Otherwise it starts in the air, with thrusts that balance roll and pitch.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from heli3dof.model.base import LoopResult, LoopTask
from heli3dof.model.compiled import compiled
from heli3dof.model.control.controller import N_OUT, after_law, before_law, open_loop_arguments
from heli3dof.model.control.simulated_controller import controller_arrays, simulated_law
from heli3dof.model.estimation.filter_data import ON_TABLE_BELOW
from heli3dof.model.greybox.linearisation import balance, true_angles
from heli3dof.model.physics.integrator import fly_row, readings, setup, stop_at_table
from heli3dof.model.physics.state_layout import FLANK

if TYPE_CHECKING:
    from heli3dof.model.greybox.model import GreyBoxModel

_before, _after = compiled(before_law, leaf=True), compiled(after_law, leaf=True)


@partial(compiled, error_model="numpy", nogil=True)
def _fly(  # type: ignore[no-untyped-def]
    s, first, address, par, mem, free, x, F, low, p, c, opened, bounds, z, reference, extra,
    grid0, grid, t, h, kick, late, angle, voltage, cmd,
):  # fmt: skip
    """Simulate N control periods; write ``angle`` (N, 3) rad, ``voltage`` and ``cmd`` (N, 2) V.

    * ``low`` (rad): roll on the table
    * ``p``, ``c``: parameters and state of `simulated_law`; ``reference`` and ``extra``: its input
    * ``opened``, ``bounds``, ``z``: the result of `open_loop_arguments`
    * ``grid``, ``grid0`` (3,) rad: encoder steps (0: not quantised), and a reading on the grid
    * ``kick`` (N, 3) or (0, 3) rad/s: random changes of the rates
    * ``late``: 1 if each voltage acts one control period late, else 0

    Other arguments: see `heli3dof.model.physics.integrator`.
    """
    setup(s, first, address, par, mem)
    s[FLANK] = s[FLANK + 1] = s[FLANK + 2] = 2.0
    y, slope, out = np.empty(3), np.empty(3), np.empty(N_OUT)
    w, cache = np.zeros((8, 3)), np.full(6, -1.0)
    N = reference.shape[0]
    target = np.empty((N, 2))
    for k in range(N):
        readings(s, x, first, address, par, mem, y, slope)
        for i in range(3):
            angle[k, i] = y[i]
            if grid[i] > 0.0:
                y[i] = grid0[i] + np.rint((y[i] - grid0[i]) / grid[i]) * grid[i]
        if opened.shape[0] > 0:
            _before(p, c, bounds, z, opened[k], y, reference[k], extra[k])
        simulated_law(p, c, y, reference[k], extra[k], out)
        if opened.shape[0] > 0:
            _after(p, c, z, opened[k], extra[k], out)
        for i in range(2):
            cmd[k, i] = out[i]
            if k == 0:
                voltage[0, i] = out[2 + i]
            if k + late < N:
                voltage[k + late, i] = out[2 + i]
        fly_row(s, x, k, t, h, voltage, target, F, first, address, par, mem, free, w, cache)
        if kick.shape[0] > 0:
            for i in range(3):
                x[3 + i] += kick[k, i]
                x[i] += 0.5 * h[k] * kick[k, i]
        stop_at_table(x, low)


def on_table(angle0: np.ndarray) -> bool:
    """Return True if a rig at rest at ``angle0`` (3,) rad lies on its table."""
    return bool(angle0[0] < ON_TABLE_BELOW)


def fly(
    model: GreyBoxModel,
    task: LoopTask,
    *,
    t: np.ndarray | None = None,
    offset: np.ndarray | None = None,
    kick: np.ndarray | None = None,
    late: bool = False,
) -> LoopResult:
    """Return the closed-loop flight that ``task`` describes, simulated from rest at ``angle0``.

    A NaN in ``angle0`` counts as zero. The result of a diverging loop contains inf and NaN.
    ``t`` (N,) s: the sampling instants; None: every ``task.dt`` s. ``offset`` (3,) rad is added to
    the initial angles. ``kick`` (N, 3) rad/s is added to the rates at the end of each period.
    ``late``: each voltage acts one period later.
    """
    N = len(task.reference)
    read0 = np.nan_to_num(np.asarray(task.angle0, dtype=float))
    x = np.concatenate([true_angles(model, read0), np.zeros(3)])
    if offset is not None:
        x[:3] += offset
    F = np.zeros((max(N, 1), 2))
    if not on_table(read0):
        F[0] = balance(model, x[:3])
    grid = np.zeros(3) if task.rad_per_count is None else np.abs(task.rad_per_count)
    p, c = controller_arrays(task.controller, task.V_o, task.v_max, task.dt, read0)
    angle, voltage, cmd = np.empty((N, 3)), np.empty((N, 2)), np.empty((N, 2))
    h = np.full(N, task.dt) if t is None else np.append(np.diff(t), task.dt)
    t = task.start_s + task.dt * np.arange(N, dtype=float) if t is None else t
    reference = np.ascontiguousarray(np.nan_to_num(task.reference, nan=0.0))
    extra = np.ascontiguousarray(np.nan_to_num(task.extra, nan=0.0))
    _fly(
        *model.structure.arguments(model.values), np.ones(3, dtype=bool), x, F,
        x[0] if on_table(read0) else -np.inf,
        p, c,
        *open_loop_arguments(task),
        reference, extra,
        read0, np.ascontiguousarray(grid, dtype=float), t, h,
        np.empty((0, 3)) if kick is None else kick, int(late), angle, voltage, cmd,
    )  # fmt: skip
    return LoopResult(
        t=t,
        angle=angle,
        voltage=voltage,
        voltage_cmd=cmd,
        reference=None if task.opened is None else reference,
        extra=None if task.opened is None else extra,
    )
