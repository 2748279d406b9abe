"""Free flights of a `GreyBoxModel` from many starts, read at a few instants of each.

From the filter's state x̂[k] (angles up to row k only) the rig runs free through the recorded
voltages, as `heli3dof.model.greybox.prediction` lets it,

    ŷ[k, j] = y(x̂[k], V, t_k + h_j),      e[k, j] = angle[k + n_j] − ŷ[k, j],   h_j = n_j dt

but one run serves all instants, and only the starts asked for are run: fifty times quicker than
a prediction of every row at every horizon, which is what a fit to such errors needs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from heli3dof.model.compiled import compiled
from heli3dof.model.estimation.ekf_jitter import positions
from heli3dof.model.greybox.prediction import STEP_S, impulse
from heli3dof.model.physics import dry_friction, integrator, rigid_body
from heli3dof.model.physics import state_layout as _s
from heli3dof.model.physics.dry_friction import settle
from heli3dof.model.physics.integrator import coast, readings, setup
from heli3dof.model.physics.parametrisation import Structure

R, T, F_FRONT, V_FRONT, STEPPED = _s.R, _s.T, _s.F_FRONT, _s.V_FRONT, _s.STEPPED


def _windows(  # type: ignore[no-untyped-def]
    s, first, address, par, mem, where, free, t, V, mean, X, low, starts, ahead, stride, out
):
    """out (S, M, 3): readings ``ahead`` (M,) rows, rising, after each of ``starts`` (S,)."""
    setup(s, first, address, par, mem)
    x, w = np.empty(6), np.zeros((8, 3))
    m, slope = np.empty(3), np.empty(3)
    for n in range(starts.shape[0]):
        k = starts[n]
        for j in range(6):
            x[j] = X[k, j]
        for q in range(where.shape[0]):
            par[where[q, 0], where[q, 1]] = X[k, 6 + where[q, 2]]
        a = k
        for i in range(ahead.shape[0]):
            end = k + ahead[i]
            while a < end:
                b = min(a + stride, end)
                h = t[b] - t[a]
                s[T], s[STEPPED] = t[a], 1.0
                coast(s, x, a, b, h, mean, V, first, address, par, mem, free, w)
                w[3, 0] = w[3, 1] = w[3, 2] = 0.0
                settle(s, x, h, first, address, par, mem, free, w)
                if x[0] < low:
                    x[0] = low
                    if x[3] < 0.0:
                        x[3] = 0.0
                a = b
            readings(s, x, first, address, par, mem, m, slope)
            for q in range(3):
                out[n, i, q] = m[q]


_windows_compiled = compiled(
    _windows,
    calls=(
        rigid_body._accelerations,
        rigid_body._body_accelerations,
        integrator._readings,
        integrator._coast,
        dry_friction._settle,
    ),
    error_model="numpy",
    nogil=True,
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Flight:
    """A recording, N rows, as the windows need it."""

    t: np.ndarray
    """(N,) s"""
    h: np.ndarray
    """(N,) s to the next row"""
    V: np.ndarray
    """(N, 2) V"""
    y: np.ndarray
    """(N, 3) rad"""
    free: np.ndarray
    """(3,) bool: axes that move"""
    low: float
    """rad: the table; −∞ where there is none"""
    starts: np.ndarray
    """(S,) int64: rows from which a window flies"""
    still: bool = False
    """The rotors stand still at the first row."""

    @property
    def dt(self) -> float:
        return float(np.median(self.h))


def errors(
    structure: Structure,
    values: np.ndarray,
    flight: Flight,
    states: np.ndarray,
    ahead: np.ndarray,
    varying: tuple[str, ...] = (),
) -> np.ndarray:
    """(S, M, 3) rad: angle − prediction, ``ahead`` (M,) rows after each of the flight's starts.

    ``states`` (N, 6 + B): the filter's, with the numbers that ``varying`` names.
    """
    hooks = structure.hooks
    s, par = structure.arrays(values)
    mean = impulse(structure, values, flight.V, flight.h, still=flight.still)
    out = np.empty((len(flight.starts), len(ahead), 3))
    _windows_compiled(
        s, hooks.first, hooks.address, par, structure.memory, positions(structure, varying),
        flight.free, flight.t, flight.V, mean, states, flight.low, flight.starts,
        np.asarray(ahead, dtype=np.int64), max(1, round(STEP_S / flight.dt)), out,
    )  # fmt: skip
    return np.asarray(flight.y[np.add.outer(flight.starts, ahead)] - out)
