"""Predict with a grey-box model: simulate from filtered states with the recorded voltages.

An extended Kalman filter (`heli3dof.model.estimation.ekf_quantised`, or `ekf_jitter` if parameters
vary by recording) estimates the state at each row from readings up to that row. From there the
model is simulated to the horizon in steps of about `STEP_S`, with the thrusts' mean over each step.
While the rig rests on its table, the state is the measured angles with zero rates. The predicted
roll stays at or above its value on the table.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

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
from heli3dof.model.physics.integrator import coast_to, readings, setup
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.model.physics.rotor import thrusts
from heli3dof.model.physics.state_layout import FLANK, SLEW, TAU_M
from heli3dof.recording.recording import Recording

if TYPE_CHECKING:
    from heli3dof.model.greybox.model import GreyBoxModel

STEP_S = 0.02
"""s, the step of the simulation, rounded to whole rows."""
NOISE = np.array([0.05, 0.15, 0.05])
"""(3,) rad/s²/√Hz for a model without noise values; see `heli3dof.model.linear.prediction`."""


def _roll(s, first, address, par, mem, where, free, t, V, mean, X, low, n, stride, out):  # type: ignore[no-untyped-def]
    """Predict n rows ahead from each state X[k]; write the encoder readings to ``out[k + n]``.

    ``out`` (N, 3) is in rad; ``mean`` (N + 1, 2): the thrusts' time integral (`impulse`); ``low``:
    roll on the table in rad; ``stride``: rows per step; ``where`` (W, 3): `positions` of parameters
    that vary by recording. Other arguments: see `integrator`.
    """
    setup(s, first, address, par, mem)
    x, w = np.empty(6), np.zeros((8, 3))
    m, slope = np.empty(3), np.empty(3)
    for k in range(X.shape[0] - n):
        if X[k, 0] != X[k, 0]:
            continue
        for j in range(6):
            x[j] = X[k, j]
        for j in range(where.shape[0]):
            par[where[j, 0], where[j, 1]] = X[k, 6 + where[j, 2]]
        coast_to(s, x, k, k + n, stride, t, mean, V, low, first, address, par, mem, free, w)
        for i in range(3):  # the flank of a backlash, by the direction of motion
            s[FLANK + i] = 1.0 if x[i] > X[k, i] else -1.0
        readings(s, x, first, address, par, mem, m, slope)
        for i in range(3):
            out[k + n, i] = m[i]


_roll_compiled = compiled(_roll, error_model="numpy")


def predict(model: GreyBoxModel, recording: Recording, horizon_s: float) -> np.ndarray:
    """Return predicted angles (N, 3) rad; row k predicts the recorded ``angle[k]``.

    Row k uses readings up to ``horizon_s`` s before it, and voltages of all rows before k. The
    first rows, and axes that were not measured, are NaN.
    """
    N = len(recording)
    n = max(1, round(horizon_s / recording.dt))
    out = np.full((N, 3), np.nan)
    if n >= N:
        return out
    if recording not in model._filtered:
        model._filtered[recording] = filtered(model, recording)
    t, V, mean, X, low, free = model._filtered[recording]
    hooks = model.structure.hooks
    s, par = model.structure.arrays(model.values)
    stride = max(1, round(STEP_S / recording.dt))
    _roll_compiled(
        s, hooks.first, hooks.address, par, model.structure.memory,
        positions(model.structure, tuple(model.varying)), free, t, V, mean, X, low, n, stride, out,
    )  # fmt: skip
    out[:, ~free] = np.nan
    return out


def filtered(
    model: GreyBoxModel, recording: Recording
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float, np.ndarray]:
    """Filter a recording; return (t, V, thrust integral, states X, roll on the table, axes).

    t (N,) s: times. V (N, 2) V: voltages without NaN. The integral (N + 1, 2) N·s is from
    `impulse`, the roll on the table (rad) from `table_of`. X (N, 6 + B) holds angles, rates and the
    B parameters in ``model.varying``, which the filter re-estimates. axes (3,) bool: measured axes.
    """
    N = len(recording)
    y, recording = recording.angle, replace(recording, voltage=hold_last(recording.voltage))
    V = np.ascontiguousarray(mean_voltage(recording))
    t = recording.t - recording.t[0]
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
    hooks = model.structure.hooks
    s, par = model.structure.arrays(model.values)
    free = np.asarray(np.isfinite(y).any(axis=0))
    m, slope = np.empty(3), np.empty(3)
    for k in np.flatnonzero(table):  # from readings to angles, with an encoder's offset
        readings(s, X[k], hooks.first, hooks.address, par, model.structure.memory, m, slope)
        X[k, :3] -= (m - X[k, :3]) / slope
    if runs:
        d = data_of([recording], runs)
        a = np.where(model.noise > 0, model.noise, NOISE)
        if model.varying:
            states = filter_jittered(
                model.structure, model.values, d, a, model.jitter_s, model.varying
            ).states
        else:
            noise = np.append(a, model.jitter_s)
            found = filter_quantised(
                model.structure, model.values, d, noise, encoder_noise(d), keep=2
            )
            assert found.X is not None
            states = found.X
        for run, (_, start, stop) in zip(runs, d.blocks, strict=True):
            X[run.start : run.stop] = states[start:stop]
    X[:, :3][:, ~free] = 0.0  # an axis that was not measured is fixed at level
    X[:, 3:6][:, ~free] = 0.0
    mean = impulse(model.structure, model.values, V, h, still=starts_on_table(recording))
    return t, V, mean, X, low, free


def impulse(
    structure: Structure, values: np.ndarray, V: np.ndarray, h: np.ndarray, *, still: bool = False
) -> np.ndarray:
    """Return the integral of the two thrusts, (N + 1, 2) N·s, up to each row and to the end.

    ``values`` (n,) are the parameters of ``structure``. Voltages V (N, 2) V hold for h (N,) s.
    Before the first row the rotors are in steady state, or at standstill (``still``).
    """
    if still:
        V, h = np.vstack([np.zeros(2), V]), np.concatenate([h[:1], h])
    hooks = structure.hooks
    s, par = structure.arrays(values)
    mem = structure.memory
    setup(s, hooks.first, hooks.address, par, mem)
    N = len(V)
    target, F = np.empty((N, 2)), np.empty((N, 2))
    thrusts(s, V, h, 0, N, hooks.first, hooks.address, par, mem, target, F)
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
