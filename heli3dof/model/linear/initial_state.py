"""States of a linear model: at rest at given angles, and how uncertain a state is.

Black-box models come in a basis of their own, so nothing may be asked of the state itself, only
of what it makes the outputs do. Both functions look at the free response over WINDOW s.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg as la

if TYPE_CHECKING:
    from heli3dof.model.linear.model import LinearModel

WINDOW = 0.5
"""s; longer than the rotor's lag, shorter than the paper's loop takes to move the arm."""
_ROWS = 50


def responses(
    model: LinearModel, axes: np.ndarray, window_s: float = WINDOW
) -> tuple[np.ndarray, np.ndarray]:
    """Free and forced response at about 50 instants in the next ``window_s`` s.

    Returns O (rows, n) and G (rows, 2), so that the outputs picked by ``axes`` (3,) bool are, one
    instant after the other, O x + G ũ for a start in x under a constant voltage u0 + ũ.
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
    """(n,) the state in which the model rests at ``angle0`` (3,) rad as well as it can.

    Where the state is physical (hover) it is exactly [angle0, 0]. Elsewhere it is the state that,
    under some constant voltage, keeps the outputs nearest to angle0 for the next half second, in
    least squares, the smallest such state. The free voltage stands for whatever holds the rig
    there, the table for instance. A NaN in angle0 (an axis not measured) counts as the trim y0.
    """
    angle0 = np.where(np.isfinite(angle0), angle0, model.y0)
    if model.physical_state:
        return np.concatenate([angle0 - model.y0, np.zeros(3)])
    axes = model.modelled
    O, G = responses(model, axes)
    y = np.tile((angle0 - model.y0)[axes], len(O) // int(axes.sum()))
    # Volts against radians: bring both blocks to one scale, so that lstsq's cut-off is fair.
    scale_x = max(float(abs(O).max()), 1e-300)
    scale_u = max(float(abs(G).max()), 1e-300)
    solution = la.lstsq(np.hstack([O / scale_x, G / scale_u]), y, cond=1e-9)[0]
    return np.asarray(solution[: model.order] / scale_x)


def state_spread(model: LinearModel, axes: np.ndarray) -> np.ndarray:
    """(n, n) the covariance of a state whose free response is uncertain by 1 rad rms over WINDOW.

    The inverse of the mean of (C Aʲ)ᵀ (C Aʲ) over the window, for the axes that are measured.
    Multiply it by the variance wanted (rad²). Directions that no output shows have none.
    """
    O, _ = responses(model, axes)
    W = O.T @ O / (len(O) / int(axes.sum()))
    return np.asarray(la.pinvh(W, rtol=1e-10))
