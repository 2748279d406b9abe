"""`RigidModel` simulates `rigid`'s equations in closed loop, to score physical fits.

It integrates by RK4 with a quarter of the control period under the held voltage. The peers' own
simulators are not used, so that the same code scores every fit.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from heli3dof.model.base import LoopResult, LoopTask
from heli3dof.model.control.controller import N_OUT, control_law, parameters, state_at_rest
from tests.bench.peers import rigid

SUBSTEPS = 4


@dataclass(frozen=True, eq=False)
class RigidModel:
    """A physical fit; ``values`` in the order of `rigid.NAMES`, ``known`` of `rigid.KNOWN`."""

    values: np.ndarray
    known: np.ndarray

    def fly(self, task: LoopTask) -> LoopResult:
        """Simulate the loop from rest at ``task.angle0``, with the rotors at hover thrust."""
        N = len(task.reference)
        grid = np.zeros(3) if task.rad_per_count is None else np.abs(task.rad_per_count)
        p = parameters(task.controller, task.V_o, task.v_max, task.dt)
        angle, voltage, cmd = np.empty((N, 3)), np.empty((N, 2)), np.empty((N, 2))
        _compiled()(
            (*map(float, self.values), *map(float, self.known)),
            np.concatenate([task.angle0, np.zeros(5)]),
            np.array(p), np.array(state_at_rest(p, task.angle0.tolist())), task.dt,
            np.nan_to_num(task.reference), np.nan_to_num(task.extra), np.array(task.angle0), grid,
            angle, voltage, cmd,
        )  # fmt: skip
        return LoopResult(np.arange(N) * task.dt, angle, voltage, cmd)


@cache
def _compiled() -> Any:
    import numba

    derivative, law = numba.njit(rigid.derivative), numba.njit(control_law)

    @numba.njit
    def slope(x, v, P):  # type: ignore[no-untyped-def]
        return np.array(derivative(x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], v[2], v[3], P))

    @numba.njit
    def fly(P, x, p, s, dt, reference, extra, zero, grid, angle, voltage, cmd):  # type: ignore[no-untyped-def]
        y, v = np.empty(3), np.empty(N_OUT)
        h = dt / SUBSTEPS
        for k in range(reference.shape[0]):
            for i in range(3):
                angle[k, i] = y[i] = x[i]
                if grid[i] > 0.0:
                    y[i] = zero[i] + np.rint((x[i] - zero[i]) / grid[i]) * grid[i]
            law(p, s, y, reference[k], extra[k], v)
            cmd[k], voltage[k] = v[:2], v[2:]
            for _ in range(SUBSTEPS):
                k1 = slope(x, v, P)
                k2 = slope(x + h / 2 * k1, v, P)
                k3 = slope(x + h / 2 * k2, v, P)
                k4 = slope(x + h * k3, v, P)
                x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

    return fly
