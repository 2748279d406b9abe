"""Predict with a grey-box model: simulate from filtered states with the recorded voltages.

An extended Kalman filter (`heli3dof.model.estimation.ekf_quantised`, or `ekf_jitter` if parameters
vary by recording) estimates the state x̂[k] at each row k from readings up to that row. From each
x̂[k] the model is simulated to the horizons h_j (s) of n_j samples. In each time step of about
`STEP_S` s, the thrusts are constant, at their mean:

    ŷ[k, j] = y(x̂[k], V, t_k + h_j),      e[k, j] = angle[k + n_j] − ŷ[k, j],   h_j = n_j dt

y(…) is the simulated reading of an encoder, V the voltages, dt the sample interval. One simulation
yields all horizons of a row. While the rig rests on its table, the state is the measured
angles with zero rates. The predicted roll stays at or above its value on the table.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from heli3dof.model.compiled import compiled
from heli3dof.model.estimation.decimated_log import mean_voltage
from heli3dof.model.estimation.ekf_jitter import filter_jittered, positions
from heli3dof.model.estimation.ekf_quantised import filter_quantised
from heli3dof.model.estimation.filter_data import (
    ON_TABLE_BELOW,
    RowRange,
    climb_rows,
    data_of,
    encoder_noise,
    hold_last,
    starts_on_table,
)
from heli3dof.model.physics.integrator import mean_thrust_steps, readings, setup
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.model.physics.rotor import thrusts
from heli3dof.model.physics.state_layout import FLANK, SLEW, TAU_M
from heli3dof.recording.recording import Recording

if TYPE_CHECKING:
    from heli3dof.model.greybox.model import GreyBoxModel

STEP_S = 0.02
"""s, the time step of the simulation, rounded to whole rows."""
NOISE = np.array([0.05, 0.15, 0.05])
"""(3,) rad/s²/√Hz, process noise for a model without noise values; see
`heli3dof.model.linear.prediction`."""


@partial(compiled, error_model="numpy", nogil=True)
def _windows(  # type: ignore[no-untyped-def]
    s, first, address, par, mem, where, free, t, V, thrust_integral, X, low, starts, ahead, stride,
    by_direction, out,
):  # fmt: skip
    """Simulate from the filter's states in S rows; write the readings at M horizons to ``out``.

    - ``out`` (S, M, 3): encoder readings (rad)
    - ``starts`` (S,): the rows in which the simulations start
    - ``ahead`` (M,): horizons in rows, ascending
    - ``X`` (N, 6 + B): the filter's state in each row. It contains three angles, three rates, and B
      parameters that vary by recording
    - ``where``: the positions in ``par`` to which the function writes these B parameters. It is the
      result of `positions`
    - ``thrust_integral`` (N + 1, 2): the time integral of the thrusts (`impulse`)
    - ``low``: the roll angle (rad) on the table
    - ``stride``: rows per time step
    - ``by_direction``: see `predictions`

    Other arguments: see `heli3dof.model.physics.integrator`.
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
            mean_thrust_steps(
                s, x, a, b, stride, t, thrust_integral, V, low, first, address, par, mem, free, w
            )
            if by_direction:
                for q in range(3):
                    s[FLANK + q] = 1.0 if x[q] > X[k, q] else -1.0
            readings(s, x, first, address, par, mem, m, slope)
            for q in range(3):
                out[n, i, q] = m[q]
            a = b


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


_FILTERED: WeakKeyDictionary[
    GreyBoxModel, WeakKeyDictionary[Recording, tuple[Flight, np.ndarray]]
] = WeakKeyDictionary()
"""Results of `filtered` by model and recording; kept outside the model, so that it can be
pickled"""


def predict(model: GreyBoxModel, recording: Recording, horizon_s: float) -> np.ndarray:
    """Return predicted angles (N, 3) rad; row k predicts the recorded ``angle[k]``.

    The prediction for row k starts ``horizon_s`` (s) before row k. It uses all readings until this
    start and none after it, but the voltages of all rows before k. Rows that have no such start,
    and axes that were not measured, are NaN.
    """
    N = len(recording)
    n = max(1, round(horizon_s / recording.dt))
    out = np.full((N, 3), np.nan)
    if n >= N:
        return out
    known = _FILTERED.setdefault(model, WeakKeyDictionary())
    if recording not in known:
        known[recording] = filtered(model, recording)
    flight, X = known[recording]
    starts = np.flatnonzero(~np.isnan(X[: N - n, 0]))
    flight = replace(flight, starts=starts)
    predicted = predictions(
        model.structure, model.values, flight, X, np.array([n]), tuple(model.varying),
        by_direction=True,
    )  # fmt: skip
    out[starts + n] = predicted[:, 0]
    out[:, ~flight.free] = np.nan
    return out


def filtered(model: GreyBoxModel, recording: Recording) -> tuple[Flight, np.ndarray]:
    """Estimate the rig's states in a recording with the model's Kalman filter.

    Returns the recording as a `Flight` whose field ``starts`` is empty, and the states X. The
    caller sets ``starts``: the rows from which to predict. X (N, 6 + B) holds angles (rad), rates
    (rad/s) and the B parameters in ``model.varying``, which the filter re-estimates.
    """
    N = len(recording)
    y, recording = recording.angle, replace(recording, voltage=hold_last(recording.voltage))
    V = np.ascontiguousarray(mean_voltage(recording))
    t = recording.elapsed_s
    h = np.append(np.diff(t), recording.dt)
    low, table = table_of(recording)
    off = ~table & np.isfinite(y).any(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], off.astype(int), [0]])))
    spans = [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    if model.varying:
        # The climb would bias these parameters: a new run at its end estimates them again.
        cut = [
            a + climb_rows(y[a:b, 0], low, recording.dt) if math.isfinite(low) else a
            for a, b in spans
        ]
        spans = [part for (a, b), c in zip(spans, cut, strict=True) for part in ((a, c), (c, b))]
    runs = [RowRange(0, a, b) for a, b in spans if b - a > 2]
    X = np.full((N, 6 + len(model.varying)), np.nan)
    X[table, :3] = y[table]
    X[table, 3:6] = 0.0
    X[:, 6:] = [model.parameters[name] for name in model.varying]
    s, *effects = model.structure.arguments(model.values)
    free = np.asarray(np.isfinite(y).any(axis=0))
    m, slope = np.empty(3), np.empty(3)
    # On the table: the angles at these readings, which differ by an encoder's offset or scale.
    for k in np.flatnonzero(table):
        readings(s, X[k], *effects, m, slope)
        X[k, :3] -= (m - X[k, :3]) / slope
    if runs:
        d = data_of([recording], runs)
        filter_inputs = model.structure, model.values, d, noise_of(model)
        if model.varying:
            states = filter_jittered(*filter_inputs, model.varying).states
        else:
            found = filter_quantised(*filter_inputs, encoder_noise(d), keep=2)
            assert found.X is not None
            states = found.X
        for run, (_, start, stop) in zip(runs, d.blocks, strict=True):
            X[run.start : run.stop] = states[start:stop]
    X[:, :3][:, ~free] = 0.0  # an axis that was not measured is fixed at level
    X[:, 3:6][:, ~free] = 0.0
    starts = np.empty(0, dtype=np.int64)
    return Flight(t, h, V, y, free, low, starts, starts_on_table(recording)), X


def noise_of(model: GreyBoxModel) -> np.ndarray:
    """Return an array (4,): the process noise of 3 axes (rad/s²/√Hz), and the sampling jitter (s).

    The values are those of the model. Where the model's process noise is zero, the value of `NOISE`
    replaces it. The jitter is the standard deviation of the sampling instants.
    """
    return np.append(np.where(model.noise > 0, model.noise, NOISE), model.jitter_s)


def predictions(
    structure: Structure,
    values: np.ndarray,
    flight: Flight,
    states: np.ndarray,
    ahead: np.ndarray,
    varying: tuple[str, ...] = (),
    *,
    by_direction: bool = False,
) -> np.ndarray:
    """Return the predicted readings (S, M, 3) rad from S start rows at M horizons.

    The horizons are ``ahead`` (M,) rows. ``values`` (n,) are the parameters of ``structure``.
    ``flight`` has the recorded arrays and the start rows. ``states`` (N, 6 + B) are the filter's
    estimates: angles, rates, and the B parameters ``varying`` that replace those in ``values``.
    ``by_direction``: the direction of the predicted motion selects the side of an encoder's
    backlash; otherwise the reading is in the middle of the backlash.
    """
    thrust_integral = impulse(structure, values, flight.V, flight.h, still=flight.still)
    out = np.empty((len(flight.starts), len(ahead), 3))
    starts = np.ascontiguousarray(flight.starts)  # numba compiles again for a strided array
    _windows(
        *structure.arguments(values), positions(structure, varying), flight.free, flight.t,
        flight.V, thrust_integral, states, flight.low, starts,
        np.asarray(ahead, dtype=np.int64), max(1, round(STEP_S / flight.dt)), by_direction, out,
    )  # fmt: skip
    return out


def errors(
    structure: Structure,
    values: np.ndarray,
    flight: Flight,
    states: np.ndarray,
    ahead: np.ndarray,
    varying: tuple[str, ...] = (),
) -> np.ndarray:
    """Return the prediction errors (S, M, 3) in rad: recorded minus predicted encoder readings.

    The predictions start from S rows and have M horizons. `predictions` explains the arguments.
    """
    predicted = predictions(structure, values, flight, states, ahead, varying)
    return np.asarray(flight.y[np.add.outer(flight.starts, ahead)] - predicted)


def impulse(
    structure: Structure, values: np.ndarray, V: np.ndarray, h: np.ndarray, *, still: bool = False
) -> np.ndarray:
    """Return the integral of the two thrusts, (N + 1, 2) N·s, up to each row and to the end.

    ``values`` (n,) are the parameters of ``structure``. Voltages V (N, 2) V hold for h (N,) s.
    Before the first row the rotors are in steady state, or at standstill (``still``).
    """
    if still:
        V, h = np.vstack([np.zeros(2), V]), np.concatenate([h[:1], h])
    s, *effects = structure.arguments(values)
    setup(s, *effects)
    N = len(V)
    target, F = np.empty((N, 2)), np.empty((N, 2))
    thrusts(s, V, h, 0, N, *effects, target, F)
    tau = float(s[TAU_M])
    late = tau * (1 - np.exp(-h / tau)) if tau > 0 else np.zeros(N)
    step = target * h[:, None] + (F - target) * late[:, None]
    if s[SLEW] > 0:
        step = 0.5 * (F + np.vstack([F[1:], target[-1:]])) * h[:, None]
    return np.vstack([np.zeros(2), np.cumsum(step[still:], axis=0)])


def table_of(recording: Recording) -> tuple[float, np.ndarray]:
    """Return the roll at which the rig rests on the table, and a mask (N,) of the samples there.

    The roll is in rad, and −∞ if the rig never rests on a table.
    """
    roll = recording.angle[:, 0]
    if np.isnan(roll).all() or not np.nanmin(roll) < ON_TABLE_BELOW:
        return -math.inf, np.zeros(len(roll), dtype=bool)
    low = float(np.nanmin(roll))
    with np.errstate(invalid="ignore"):
        return low, np.asarray(roll <= low + 2.5 * abs(recording.profile.encoder.rad_per_count[0]))
