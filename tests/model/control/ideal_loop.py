"""The paper's closed loop in continuous time: eq (7) with the gain K_g (14), errata corrected.

::

    V − V_o = K_p (y_ref − y) − K_d ẏ + K_i ξ,    ξ̇ = (r_ref − r, ψ_ref − ψ)

y = (r, p, ψ) in rad; K_p, K_d, K_i are the columns of K_g. The printed eq (7) lacks the factor that
K_g multiplies (erratum E5), and the printed model lacks the integrals ξ (erratum E6). The rates are
exact derivatives of y, not of the error, and the integrals have no clamp. The paper's results for
its hover model are from this loop; the rig runs `heli3dof.model.control.controller`. Without a
voltage limit the response is exact, by matrix exponentials between the corners of the reference.
`paper_gain` is the LQR design of K_g.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as la

from heli3dof.model.control.closed_loop_poles import INTEGRATED, closed_loop, rightmost_first
from heli3dof.model.control.lqr import Q, R
from heli3dof.model.linear.hover import Hover


@dataclass(frozen=True, eq=False)
class Response:
    """The simulated response at N instants: times (s), angles (rad), voltages V − V_o (V)."""

    t: np.ndarray
    """(N,) s, times"""
    angle: np.ndarray
    """(N, 3) rad, roll, pitch, yaw"""
    voltage: np.ndarray
    """(N, 2) V, motor voltages minus V_o, after the voltage limit if there is one"""


def paper_gain(hover: Hover) -> np.ndarray:
    """Return the LQR gain (2, 8) of the six states and two integrals, with the paper's Q and R.

    K = R⁻¹BᵀP, where P solves the Riccati equation AᵀP + PA − PBR⁻¹BᵀP + Q = 0. For the corrected
    hover model with V_o from eq (6), K equals the paper's gain (14) up to its truncated digits.
    This is the evidence for errata E3 (a sign in A) and E4 (a factor in B).
    """
    A = np.zeros((8, 8))
    A[:6, :6] = hover.A
    for row, axis in enumerate(INTEGRATED):
        A[6 + row, axis] = 1.0  # ξ̇ = +y here: the LQR regulates y to zero
    B = np.vstack([hover.B, np.zeros((2, 2))])
    P = la.solve_continuous_are(A, B, np.diag(Q), R * np.eye(2))
    return np.asarray(B.T @ P / R)


def with_rotor_lag(hover: Hover, tau: float) -> Hover:
    """Return the hover model extended by first-order rotors, τ V̇_r = V − V_r, with τ = ``tau`` s.

    V is a motor voltage and V_r the voltage that determines the thrust. The two additional states
    are V_r − V_o in V. The lag is not in the paper. It may explain why the paper's rig overshot far
    more than the paper's model.
    """
    A, B = np.zeros((8, 8)), np.zeros((8, 2))
    A[:6, :6], A[:6, 6:], A[6:, 6:] = hover.A, hover.B, -np.eye(2) / tau
    B[6:] = np.eye(2) / tau
    return replace(hover, A=A, B=B, C=np.eye(3, 8))


def loop_poles(hover: Hover, K: np.ndarray) -> np.ndarray:
    """Return the closed-loop poles (rad/s, rightmost first) of ``hover`` with the gain K (2, 8)."""
    return rightmost_first(la.eigvals(closed_loop(hover.A, hover.B, hover.C, K)[0]))


def step_response(
    hover: Hover,
    K: np.ndarray,
    target: np.ndarray,
    *,
    duration_s: float = 20.0,
    dt: float = 1e-3,
    rate_limit: float | None = None,
    angle0: np.ndarray | None = None,
    x0: np.ndarray | None = None,
    v_max: float | None = None,
) -> Response:
    """Simulate a step of the references to ``target`` (3,) rad at t = 0, for ``duration_s``.

    The loop is ``hover`` under the gain ``K`` (2, 8). It starts at rest at ``angle0`` (3,) rad,
    level by default, or in the state ``x0``. With a ``rate_limit`` (rad/s) the references ramp from
    the start angles. ``v_max`` (V) limits each motor voltage V: the function then integrates by
    Runge–Kutta 4 with step ``dt`` (s). Without ``v_max`` the response is exact.
    """
    if x0 is None:
        x0 = np.zeros(len(hover.A))
        x0[:3] = 0.0 if angle0 is None else angle0
    angle0 = hover.C @ x0
    target = np.asarray(target, dtype=float)
    corners = np.zeros(3) if rate_limit is None else abs(target - angle0) / rate_limit
    slope = np.zeros(3) if rate_limit is None else np.sign(target - angle0) * rate_limit
    t = np.arange(round(duration_s / dt) + 1) * dt

    def reference(at: float) -> np.ndarray:
        return np.where(at < corners, angle0 + slope * at, target)

    A, B, F = closed_loop(hover.A, hover.B, hover.C, K)
    x0 = np.concatenate([x0, np.zeros(2)])
    if v_max is None:
        x = _exact(A, B, x0, t, corners, reference, slope)
    else:
        x = _limited(hover, K, F, x0, t, reference, v_max)
    r = np.array([reference(at) for at in t])
    u = x @ F.T + r @ K[:, :3].T
    if v_max is not None:
        u = np.clip(u + hover.V_o, -v_max, v_max) - hover.V_o
    return Response(t, x[:, : len(hover.A)] @ hover.C.T, u)


def _exact(
    A: np.ndarray,
    B: np.ndarray,
    x0: np.ndarray,
    t: np.ndarray,
    corners: np.ndarray,
    reference: Callable[[float], np.ndarray],
    slope: np.ndarray,
) -> np.ndarray:
    """Return the exact states x (N, n) of ẋ = A x + B r at the times t (N,) s, with x(0) = ``x0``.

    ``reference`` is the function r (3,) rad of time. Each r_i has the slope ``slope``[i] (rad/s) up
    to the time ``corners``[i] (s) and is constant after it.
    """
    n = len(A)
    M = np.zeros((n + 6, n + 6))
    M[:n, :n], M[:n, n : n + 3] = A, B
    M[n : n + 3, n + 3 :] = np.eye(3)
    step = la.expm(M * (t[1] - t[0]))
    x = np.empty((len(t), n))
    starts = [0.0, *sorted({float(c) for c in corners if 0 < c < t[-1]}), np.inf]
    start_state = x0
    for start, stop in itertools.pairwise(starts):
        z = np.concatenate([start_state, reference(start), np.where(start < corners, slope, 0.0)])
        inside = np.nonzero((t >= start) & (t < stop))[0]
        z_at = la.expm(M * (t[inside[0]] - start)) @ z if len(inside) else z
        for k in inside:
            x[k] = z_at[:n]
            z_at = step @ z_at
        if np.isfinite(stop):
            start_state = (la.expm(M * (stop - start)) @ z)[:n]
    return x


def _limited(
    hover: Hover,
    K: np.ndarray,
    F: np.ndarray,
    x0: np.ndarray,
    t: np.ndarray,
    reference: Callable[[float], np.ndarray],
    v_max: float,
) -> np.ndarray:
    """Return the states x (N, n) of ẋ = A x + B u at the times t (N,) s, by Runge–Kutta 4.

    x(0) is ``x0``. The plant is ``hover`` with two error integrals. The feedback u = F x + K_p r,
    K_p = K[:, :3], is limited so that |V_o + u| ≤ ``v_max`` (V). ``reference`` is the function
    r (3,) rad of time.
    """
    A, B, C, V_o, Kp = hover.A, hover.B, hover.C, hover.V_o, K[:, :3]
    n = len(A)

    def slope(at: float, x: np.ndarray) -> np.ndarray:
        r = reference(at)
        u = np.clip(F @ x + Kp @ r + V_o, -v_max, v_max) - V_o
        e = r - C @ x[:n]
        return np.concatenate([A @ x[:n] + B @ u, [e[i] for i in INTEGRATED]])

    dt = t[1] - t[0]
    x = np.empty((len(t), len(x0)))
    x[0] = x0
    for k, at in enumerate(t[:-1]):
        k1 = slope(at, x[k])
        k2 = slope(at + dt / 2, x[k] + dt / 2 * k1)
        k3 = slope(at + dt / 2, x[k] + dt / 2 * k2)
        k4 = slope(at + dt, x[k] + dt * k3)
        x[k + 1] = x[k] + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return x
