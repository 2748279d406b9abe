"""Compute errors of multi-step predictions of a grey-box model from selected rows.

The Kalman filter's state x̂[k] uses angles up to row k. From there the model is simulated with the
recorded voltages, as in `heli3dof.model.greybox.prediction`, to several horizons h_j:

    ŷ[k, j] = y(x̂[k], V, t_k + h_j),      e[k, j] = angle[k + n_j] − ŷ[k, j],   h_j = n_j dt

y(…) is the simulated reading of an encoder, V the voltages; h_j has n_j sample intervals dt. One
simulation per selected row yields all its horizons. This is fifty times faster than predicting
every row at every horizon, fast enough to fit a model to these errors.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from heli3dof.model.compiled import compiled
from heli3dof.model.estimation.ekf_jitter import positions
from heli3dof.model.greybox.prediction import STEP_S, impulse
from heli3dof.model.physics.integrator import coast_to, readings, setup
from heli3dof.model.physics.parametrisation import Structure


def _windows(  # type: ignore[no-untyped-def]
    s, first, address, par, mem, where, free, t, V, mean, X, low, starts, ahead, stride, out
):
    """Simulate from the filter's states in S rows; write the readings at M horizons to ``out``.

    ``out`` (S, M, 3) rad: encoder readings; ``starts`` (S,): start rows; ``ahead`` (M,): horizons
    in rows, ascending; X (N, 6 + B): filter's states; ``where`` (W, 3): `positions` of the B
    parameters that vary by recording; ``mean`` (N + 1, 2): the thrusts' time integral (`impulse`);
    ``low``: roll on the table (rad); ``stride``: rows per step. Other arguments: see `integrator`.
    """
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
            b = k + ahead[i]
            coast_to(s, x, a, b, stride, t, mean, V, low, first, address, par, mem, free, w)
            readings(s, x, first, address, par, mem, m, slope)
            for q in range(3):
                out[n, i, q] = m[q]
            a = b


_windows_compiled = compiled(_windows, error_model="numpy", nogil=True)


@dataclass(frozen=True, eq=False)
class Flight:
    """A recording of N rows as arrays, with the S rows from which predictions start."""

    t: np.ndarray
    """(N,) s, sampling times"""
    h: np.ndarray
    """(N,) s, time to the next row"""
    V: np.ndarray
    """(N, 2) V, motor voltages"""
    y: np.ndarray
    """(N, 3) rad, encoder readings"""
    free: np.ndarray
    """(3,) bool: the axes that can move"""
    low: float
    """rad, the roll at which the rig rests on its table; −∞ without a table"""
    starts: np.ndarray
    """(S,) int64: rows from which predictions start"""
    still: bool = False
    """True if the rotors are at standstill before the first row, else in steady state."""

    @property
    def dt(self) -> float:
        """Return the median sample interval in s."""
        return float(np.median(self.h))


def errors(
    structure: Structure,
    values: np.ndarray,
    flight: Flight,
    states: np.ndarray,
    ahead: np.ndarray,
    varying: tuple[str, ...] = (),
) -> np.ndarray:
    """Return the prediction errors (S, M, 3) rad from S start rows at M horizons.

    An error is the reading minus the prediction. The horizons are ``ahead`` (M,) rows. ``values``
    (n,) are the parameters of ``structure``. ``flight`` has the recorded arrays and the start rows.
    ``states`` (N, 6 + B) are the filter's estimates: angles, rates, and the B parameters
    ``varying`` that replace those in ``values``.
    """
    hooks = structure.hooks
    s, par = structure.arrays(values)
    mean = impulse(structure, values, flight.V, flight.h, still=flight.still)
    out = np.empty((len(flight.starts), len(ahead), 3))
    starts = np.ascontiguousarray(flight.starts)  # numba compiles again for a strided array
    _windows_compiled(
        s, hooks.first, hooks.address, par, structure.memory, positions(structure, varying),
        flight.free, flight.t, flight.V, mean, states, flight.low, starts,
        np.asarray(ahead, dtype=np.int64), max(1, round(STEP_S / flight.dt)), out,
    )  # fmt: skip
    return np.asarray(flight.y[np.add.outer(flight.starts, ahead)] - out)
