"""Initial states of a linear model: the state at rest, and the covariance of an uncertain state.

The states of a black-box model have no physical meaning, but the outputs that follow from them have
one. The state at rest keeps the outputs at rest for `WINDOW` seconds, with the constant voltage
that fits best. The covariance is chosen so that the outputs, without input, have a given variance
during these seconds.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg as la

if TYPE_CHECKING:
    from heli3dof.model.linear.model import LinearModel

WINDOW = 0.5
"""s, duration of the free response; longer than the rotors' lag, shorter than a movement in closed
loop."""
_ROWS = 50


def responses(
    model: LinearModel, axes: np.ndarray, window_s: float = WINDOW
) -> tuple[np.ndarray, np.ndarray]:
    """Return the matrices O (rows, n) and G (rows, 2) of the model's free and forced response.

    O x + G ũ are outputs minus the trim y0, for the initial state x and the constant voltage
    u0 + ũ. The rows are the axes that ``axes`` (3,) bool selects, at the first instant, then at the
    next, and so on. Up to 100 instants span ``window_s`` s.
    """
    n = model.order
    steps = max(round(window_s / model.dt), n)
    stride = max(1, steps // _ROWS)
    M = np.eye(n + 2)
    M[:n, :n], M[:n, n:] = model.A, model.B
    M = np.linalg.matrix_power(M, stride)
    C = np.hstack([model.C[axes], np.zeros((int(axes.sum()), 2))])
    rows = [C]
    for _ in range(steps // stride):
        rows.append(rows[-1] @ M)
    stacked = np.vstack(rows)
    return stacked[:, :n], stacked[:, n:]


def rest_state(model: LinearModel, angle0: np.ndarray) -> np.ndarray:
    """Return the model's state vector (n,) for a rig at rest at the angles ``angle0`` (3,) rad.

    For the hover model it is (angle0 − y0, 0): the angles' deviations from the trim y0, and zero
    rates. States of other models have no physical meaning. There the function solves for a state
    and a constant voltage that keep the outputs at angle0 for `WINDOW` seconds (least squares). It
    discards the voltage, because at rest the table may carry the rig. A NaN in angle0 counts as y0.
    """
    angle0 = np.where(np.isfinite(angle0), angle0, model.y0)
    if model.physical_state:
        return np.concatenate([angle0 - model.y0, np.zeros(3)])
    axes = model.modelled
    O, G = responses(model, axes)
    y = np.tile((angle0 - model.y0)[axes], len(O) // int(axes.sum()))
    # Scale both blocks to magnitude 1, so that lstsq's cut-off treats radians and volts equally.
    scale_x = max(float(abs(O).max()), 1e-300)
    scale_u = max(float(abs(G).max()), 1e-300)
    solution = la.lstsq(np.hstack([O / scale_x, G / scale_u]), y, cond=1e-9)[0]
    return np.asarray(solution[: model.order] / scale_x)


def state_spread(model: LinearModel, axes: np.ndarray) -> np.ndarray:
    """Return the initial state's covariance (n, n) for an output uncertainty of 1 rad rms.

    The covariance is the inverse of the mean of (C Aʲ)ᵀ (C Aʲ) over the samples j of `WINDOW`
    seconds. C has the rows of the measured ``axes`` (3,) bool. For another output uncertainty,
    multiply the covariance by the output's variance (rad²). Unobservable directions of the state
    get zero variance.
    """
    O, _ = responses(model, axes)
    W = O.T @ O / (len(O) / int(axes.sum()))
    return np.asarray(la.pinvh(W, rtol=1e-10))
