"""Find initial values for the multi-step fit, from the equations of motion in weak form.

Let φ be a test function whose value and slope vanish at both ends of a time span. Two integrations
by parts move the derivatives from the measured angles q to φ:

    ∫ φ″ q dt = ∫ φ q̈(q, q̇, F; θ) dt,      φ(τ) = (1 − τ²)³,  τ ∈ [−1, 1]

θ are the parameters, τ is the time scaled to the span. So no measurement is differentiated twice,
and sampling jitter has little effect. q are the readings, corrected for the modelled encoder
effects. q̇ is their derivative by a local polynomial over `SMOOTH_S`. The thrusts F follow from the
voltages. Overlapping spans of the lengths `SPANS_S` (s) cover the prediction windows of the
multi-step fit. With e the left side minus the right side, and the prior N(θ_0, Λ⁻¹), the fit
minimises

    Σ (2 asinh(e/2s))² + (θ − θ_0)ᵀ Λ (θ − θ_0)

where s is the errors' scale: 1.48 × the median of |e|, for each axis and span length. Each of
`ROUNDS` rounds estimates s again. Nothing is simulated, so the search converges in seconds, even
from values at which a simulation diverges. Noise in q and q̇ biases the result slightly, so it is
only the multi-step fit's start.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from heli3dof.identification.greybox.levenberg_marquardt import LeastSquares, follow_on
from heli3dof.identification.greybox.multistep import WINDOW_S, MultiStep
from heli3dof.model.compiled import compiled
from heli3dof.model.greybox.prediction import Flight, impulse
from heli3dof.model.physics import state_layout as _s
from heli3dof.model.physics.integrator import readings, setup
from heli3dof.model.physics.rigid_body import accelerations
from heli3dof.stage_clock import Progress

R, T, F_FRONT, V_FRONT = _s.R, _s.T, _s.F_FRONT, _s.V_FRONT
SPANS_S = (0.4, 1.2)
OVERLAP = 3
"""Time spans overlap: each starts a third of its length after the previous one."""
SMOOTH_S = 0.07
ROUNDS = 4
DIFFERENCE = 1e-4
"""Step of the finite differences, in the scaled parameters z"""
SETTLED = 1e-4
"""The search ends when a step's predicted cost reduction is below this share of the cost."""
FAR = 20.0
"""An error that is not finite is replaced by this multiple of the errors' scale s."""


@partial(compiled, error_model="numpy", nogil=True)
def _evaluate_rows(s, first, address, par, mem, free, t, V, F, y, y_dot, out):  # type: ignore[no-untyped-def]
    """Write the angles (rad) and the model's accelerations (rad/s²) in each row to ``out`` (N, 6).

    y and y_dot (N, 3) are the smoothed encoder readings and their derivatives. The angles are y,
    corrected for encoder effects. F (N, 2) N are the thrusts. The module
    `heli3dof.model.physics.integrator` explains the other arguments.
    """
    setup(s, first, address, par, mem)
    x, w = np.empty(6), np.zeros((3, 3))
    m, slope = np.empty(3), np.empty(3)
    for k in range(t.shape[0]):
        s[T] = t[k]
        for i in range(2):
            s[F_FRONT + i] = F[k, i]
            s[V_FRONT + i] = V[k, i]
        for i in range(3):
            x[i] = y[k, i]
            x[3 + i] = y_dot[k, i]
        readings(s, x, first, address, par, mem, m, slope)
        for i in range(3):
            x[i] -= (m[i] - x[i]) / slope[i]
            x[3 + i] /= slope[i]
            out[k, i] = x[i]
        for i in range(6):
            s[R + i] = x[i]
        accelerations(s, first, address, par, mem, free, w[0], w[1], w[2])
        for i in range(3):
            out[k, 3 + i] = w[2, i]


@dataclass(frozen=True, eq=False)
class Span:
    """A test function φ of L rows for the weak form, placed at n positions of a flight."""

    rows: np.ndarray
    """(n,) first row of the flight at each position of the test function"""
    phi: np.ndarray
    """(L,) weights of the sum for ∫ φ · dt; they add up to 1"""
    phi_2: np.ndarray
    """(L,) weights of the sum for ∫ φ″ · dt"""

    def integrals(self, q: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return ∫ φ″ q dt − ∫ φ a dt (n, 3), in rad/s², at n positions of the test function φ.

        q (N, 3) are the angles in rad, a (N, 3) the accelerations in rad/s², in the N rows of a
        flight.
        """
        each = np.lib.stride_tricks.sliding_window_view
        L = len(self.phi)
        if len(q) < L:
            return np.empty((0, q.shape[1]))
        return np.asarray(
            each(q, L, axis=0)[self.rows] @ self.phi_2 - each(a, L, axis=0)[self.rows] @ self.phi
        )


@dataclass(frozen=True, eq=False)
class SmoothedFlight:
    """A flight with smoothed encoder readings, rates, and the test functions of the weak form."""

    flight: Flight
    y: np.ndarray
    """(N, 3) rad: encoder readings with interpolated gaps"""
    y_smooth: np.ndarray
    """(N, 3) rad: the same, smoothed"""
    y_dot: np.ndarray
    """(N, 3) rad/s: derivatives of the smoothed readings"""
    spans: tuple[Span, ...]


def smoothed_flight(flight: Flight, window_s: float = WINDOW_S) -> SmoothedFlight:
    """Return the flight with smoothed encoder readings, rates, and test functions for its windows.

    The model is fitted to time windows of the flight, which have the length ``window_s`` (s) and
    begin at the rows ``flight.starts``. The result contains the test functions of the weak form
    (see the module), and the rows at which they begin. They cover only rows inside these windows.
    """
    from scipy.signal import savgol_filter

    t, dt = flight.t, flight.dt
    y = flight.y.copy()
    for i in range(3):
        good = np.isfinite(y[:, i])
        y[:, i] = np.interp(t, t[good], y[good, i]) if good.any() else 0.0
    width = max(5, round(SMOOTH_S / dt) | 1)
    smooth = savgol_filter(y, width, 2, axis=0)
    rate = savgol_filter(y, width, 2, deriv=1, delta=dt, axis=0)
    free = np.zeros(len(t), dtype=bool)
    for k in flight.starts:
        free[k : k + round(window_s / dt)] = True
    return SmoothedFlight(flight, y, smooth, rate, tuple(span(free, dt, s) for s in SPANS_S))


def span(free: np.ndarray, dt: float, width_s: float) -> Span:
    """Return a test function of the length ``width_s`` (s) and its positions in a flight.

    At each position, the function covers only rows of prediction windows, for which ``free`` (N,)
    is True. ``dt`` (s) is the flight's sample interval.
    """
    n = round(width_s / dt)
    tau = np.linspace(-1, 1, n)
    phi = (1 - tau**2) ** 3
    phi_2 = (24 * tau**2 * (1 - tau**2) - 6 * (1 - tau**2) ** 2) * (2 / ((n - 1) * dt)) ** 2
    phi_2 -= phi_2.mean()  # ∫ φ″ dt = 0 exactly, in spite of discretisation
    bad = np.concatenate([[0], np.cumsum(~free)])
    k = np.arange(0, max(len(free) - n, 0), max(1, n // OVERLAP))
    return Span(k[bad[k + n] == bad[k]], phi / phi.sum(), phi_2 / phi.sum())


def residuals(
    problem: MultiStep, logs: Sequence[SmoothedFlight], z: np.ndarray
) -> list[np.ndarray]:
    """Return the weak form's errors: an array (n, 3) rad/s² for each length in `SPANS_S`.

    z (dim,) are the scaled parameters. n is the number of positions of the test function of this
    length in the flights ``logs``.
    """
    found: list[list[np.ndarray]] = [[] for _ in SPANS_S]
    for i, log in enumerate(logs):
        values, f, st = problem.values(z, i), log.flight, problem.structure
        mean = np.diff(impulse(st, values, f.V, f.h, still=f.still), axis=0) / f.h[:, None]
        out = np.empty((len(f.t), 6))
        _evaluate_rows(
            *st.arguments(values), f.free, f.t, f.V, mean, log.y_smooth, log.y_dot, out,
        )  # fmt: skip
        # The correction for encoder effects, computed at smoothed readings, also fits the raw ones.
        q = log.y + (out[:, :3] - log.y_smooth)
        q[:, ~f.free] = 0.0
        for j, each in enumerate(log.spans):
            found[j].append(each.integrals(q, out[:, 3:]))
    return [np.concatenate(e) for e in found]


def robust_std(e: np.ndarray) -> np.ndarray:
    """Return 1.48 × the median |e| of each axis (3,), from errors e (n, 3).

    Zeros are ignored, because they are the errors of axes that were not measured.
    """
    e = np.nan_to_num(e, nan=1e3, posinf=1e3, neginf=-1e3)
    out = np.ones(3)
    for i in range(3):
        if (there := e[:, i] != 0).any():
            out[i] = 1.4826 * np.median(np.abs(e[there, i]))
    return np.maximum(out, 1e-6)


def weak_start(
    problem: MultiStep, start: np.ndarray | None = None, *, progress: Progress | None = None
) -> np.ndarray:
    """Return the scaled parameters (dim,) from which the multi-step fit should start.

    They minimise the weak form's errors over the flights of ``problem``. The search starts at
    ``start`` (dim,); ``progress`` gets lines of text.
    """
    logs = [smoothed_flight(f) for f in problem.flights]
    z = np.clip(problem.start if start is None else start, *problem.bounds)
    for n in range(ROUNDS):
        if progress is not None:
            progress(f"initial values by the weak form, round {n + 1} of {ROUNDS}")
        scale = [robust_std(e) for e in residuals(problem, logs, z)]
        z = _minimum(problem, logs, scale, z)
    return np.asarray(z)


def _minimum(
    problem: MultiStep, logs: Sequence[SmoothedFlight], scale: Sequence[np.ndarray], z: np.ndarray
) -> np.ndarray:
    def weighted(at: np.ndarray) -> np.ndarray:
        e = [e / s for e, s in zip(residuals(problem, logs, at), scale, strict=True)]
        flat = np.concatenate([x.ravel() for x in e])
        flat = np.nan_to_num(flat, nan=FAR, posinf=FAR, neginf=-FAR)
        return np.asarray(2 * np.arcsinh(flat / 2))

    v = LeastSquares(weighted, problem.start, problem.prior, *problem.bounds, DIFFERENCE)
    return follow_on(v, z, None, settled=0.0, share=SETTLED).z
