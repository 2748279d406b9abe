"""Closed-loop poles of a linear model with the controller gain K (2 × 8), without limiters.

Continuous loop with exact rates ẏ as in the paper (docs/explanation/paper.md), and with the error
integrals ξ (rad·s) that the paper's model lacks (erratum E6)::

    ẋ = A x + B u,   ξ̇_r = r_ref − r,   ξ̇_ψ = ψ_ref − ψ
    u = K_p (y_ref − y) − K_d ẏ + K_i ξ          K = [K_p (2×3)  K_d (2×3)  K_i (2×2)]

y = (r, p, ψ) is roll, pitch, yaw (rad), y_ref their references, u the voltages minus the trim (V).

Sampled loop, as on the rig: the rates are derivatives by the Tustin-discretised filter of
`controller`. Each integral advances by dt × error after the voltage is computed. An integral adds
no pole if its column of K is zero or its axis is not modelled.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from heli3dof.model.control.controller import derivative_filter
from heli3dof.model.discretisation import continuous
from heli3dof.rig.profile import ControllerSpec

if TYPE_CHECKING:
    from heli3dof.model.linear.model import LinearModel

INTEGRATED = (0, 2)
"""The axes whose error is integrated: roll and yaw."""


def closed_loop(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, K: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the matrices (A_cl, B_cl, F) of the closed loop of a linear plant and the controller.

    The plant is ẋ = A x + B u, y = C x with n states, two voltages u and three angles y. The
    control law is u = K_p (y_ref − y) − K_d ẏ + K_i ξ in continuous time, with the true derivative
    ẏ. ξ (2,) are the integrals of the roll and yaw errors. K (2, 8) contains the gains K_p (2, 3),
    K_d (2, 3), K_i (2, 2) side by side. The closed loop with the states z = (x, ξ) is

        ż = A_cl z + B_cl y_ref          A_cl (n+2, n+2), B_cl (n+2, 3)
        u = F z + K_p y_ref              F (2, n+2)

    The last equation holds for C B = 0. If C B ≠ 0, the rate ẏ = C A x + C B u depends on u. Then
    the function solves the control law for u.
    """
    n = A.shape[0]
    Kp, Kd, Ki = K[:, :3], K[:, 3:6], K[:, 6:]
    well_posed = np.linalg.inv(np.eye(2) + Kd @ C @ B)
    F = well_posed @ np.hstack([-Kp @ C - Kd @ C @ A, Ki])
    A_cl = np.zeros((n + 2, n + 2))
    B_cl = np.zeros((n + 2, 3))
    A_cl[:n] = np.hstack([A, np.zeros((n, 2))]) + B @ F
    B_cl[:n] = B @ well_posed @ Kp
    for row, axis in enumerate(INTEGRATED):
        A_cl[n + row, :n] = -C[axis]
        B_cl[n + row, axis] = 1.0
    return A_cl, B_cl, F


def ideal_loop_poles(model: LinearModel, controller: ControllerSpec) -> np.ndarray:
    """Return the poles (rad/s, rightmost first) of the continuous-time loop with exact rates.

    ``model`` is converted to continuous time. The feedback has the gains of ``controller``, and the
    rates are the true derivatives of the angles.
    """
    c = continuous(model)
    C = np.where(model.modelled[:, None], c.C, 0.0)
    A_cl, _, _ = closed_loop(c.A, c.B, C, controller.K_g)
    keep = np.r_[np.ones(model.order, bool), _integrals_in_the_loop(model, controller)]
    return rightmost_first(np.linalg.eigvals(A_cl[np.ix_(keep, keep)]))


def sampled_loop_poles(model: LinearModel, controller: ControllerSpec, dt: float) -> np.ndarray:
    """Return the poles (rad/s, rightmost first) of the closed loop with the sampling period ``dt``.

    ``dt`` is in s. Each pole z in discrete time is converted to log(z)/dt. A pole at z = 0 (a pure
    delay) has no finite equivalent and is omitted. The loop consists of ``model``, sampled every
    ``dt`` s, and of ``controller`` with its derivative filters and integrals. So the states of the
    loop are those of the model, two per derivative filter and one per integral.
    """
    model = model.at(dt)
    axes = [i for i in range(3) if model.modelled[i]]
    n, m = model.order, len(axes)
    K = controller.K_g
    b0, a1, a2 = derivative_filter(controller, dt)
    integrals = [i for i, there in enumerate(_integrals_in_the_loop(model, controller)) if there]
    q = len(integrals)
    # Each signal is the row of its coefficients with respect to the state [x, f1, f2, ξ].
    size = n + 2 * m + q
    row = np.eye(size)
    y = np.zeros((m, size))
    y[:, :n] = model.C[axes]
    f1, f2, xi = row[n : n + m], row[n + m : n + 2 * m], row[n + 2 * m :]
    rate = b0 * y + f1
    u = -K[:, axes] @ y - K[:, [3 + i for i in axes]] @ rate + K[:, [6 + i for i in integrals]] @ xi
    step = np.empty((size, size))
    step[:n] = np.hstack([model.A, np.zeros((n, size - n))]) + model.B @ u
    step[n : n + m] = f2 - a1 * rate
    step[n + m : n + 2 * m] = -b0 * y - a2 * rate
    for i, which in enumerate(integrals):
        step[n + 2 * m + i] = xi[i] - dt * y[axes.index(INTEGRATED[which])]
    z = np.linalg.eigvals(step)
    z = z[abs(z) > 1e-9].astype(complex)
    return rightmost_first(np.log(z) / dt)


def _integrals_in_the_loop(model: LinearModel, controller: ControllerSpec) -> np.ndarray:
    """Return (2,) bool: whether the loop contains the error integral of roll, and that of yaw."""
    return np.asarray((controller.K_g[:, 6:] != 0).any(axis=0) & model.modelled[list(INTEGRATED)])


def rightmost_first(poles: np.ndarray) -> np.ndarray:
    """Return the poles sorted by falling real part; in a complex pair, Im > 0 comes first."""
    poles = np.asarray(poles, dtype=complex)
    return poles[np.lexsort((-poles.imag, -poles.real.round(9)))]
