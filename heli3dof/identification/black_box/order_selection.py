"""Choose the order of a black box: fit each order at each sampling interval, and take one fit.

Order and interval decide how good a black box is in closed loop. At an interval of 2 ms, the
innovations (one-step prediction errors) are mostly the rounding of the encoders. At 40 to 80 ms,
they are mostly motion of the rig that the model cannot predict.

A candidate is the fit of one order at one interval. Its score is the mean fit (%) over the axes, on
the *training* flights, of

* predictions 1 s ahead, and
* the closed-loop replay, if the controller is known. The replay is a simulation with the recorded
  references.

The identification methods (``pem``, ``oe``, ``pbsid``) minimise neither the 1 s prediction errors
nor the replay errors. So a larger order does not score better merely because it has more
parameters. The replay rejects models that are good one step ahead and diverge in closed loop. The
prediction rejects poor noise models.

The search chooses the smallest order whose score is at most `SCORE_TOLERANCE` percentage points
below the best. If several intervals of this order qualify, it takes the one with the highest score.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from heli3dof.errors import RecordingError
from heli3dof.identification import validation
from heli3dof.identification.black_box.pbsid import Pair, StateSpace, realise, states, varx
from heli3dof.identification.black_box.pem import PemFit, pem
from heli3dof.identification.black_box.resampling import NoContinuousModel, at_rate, trims
from heli3dof.identification.fit_result import CandidateOrder
from heli3dof.identification.preprocessing import Prepared, segments
from heli3dof.model.estimation.filter_data import RowRange
from heli3dof.model.linear.model import LinearModel
from heli3dof.parallel import report_count

INTERVALS_S = (0.04, 0.08)
ORDERS = (6, 7, 8, 9, 10)
PAST_S = 0.5
"""s: the VARX (vector autoregression with inputs) regresses on the samples of this past time."""
SCORE_TOLERANCE = 0.2
"""Percentage points: the smallest order whose score is this close to the best is chosen."""
MEMORY_S = 2.0
"""s: longest time constant of a predictor in the method ``pem``. Without this limit, it would grow
to tens of seconds in flights with little disturbance. The predictor would then remember the trim of
one flight, which is wrong in the next."""
SELECT_HORIZON_S = 1.0


@dataclass(frozen=True, eq=False)
class StateSpaceFit:
    """A black-box fit to decimated data, and the same model resampled to the control rate.

    ``state_space`` and ``pem`` (None for PBSID) are the fit to data sampled every ``interval_s`` s,
    ``model`` is the resampled model. The data's means are u_mean (2,) V and y_mean (3,) rad.
    """

    model: LinearModel
    state_space: StateSpace
    pem: PemFit | None
    interval_s: float
    u_mean: np.ndarray
    y_mean: np.ndarray


@dataclass(frozen=True, eq=False)
class Decimated:
    """Voltages and angles (u, y) by segment, sampled every ``interval_s`` s, minus their means.

    The means are u_mean (2,) V and y_mean (3,) rad.
    """

    data: tuple[Pair, ...]
    u_mean: np.ndarray
    y_mean: np.ndarray
    interval_s: float


def decimated(prepared: Prepared, runs: Sequence[RowRange], interval_s: float) -> Decimated:
    """Return voltages and angles of ``runs``, decimated to an interval near ``interval_s`` (s).

    The interval is a multiple of the control period. The means over all runs are subtracted.
    """
    factor = max(1, round(interval_s / prepared.dt))
    cut = segments(prepared, runs, factor)
    u_mean = np.vstack([u for u, _ in cut]).mean(axis=0)
    y_mean = np.vstack([y for _, y in cut]).mean(axis=0)
    data = tuple((u - u_mean, y - y_mean) for u, y in cut)
    return Decimated(data, u_mean, y_mean, factor * prepared.dt)


def varx_order(d: Decimated, largest_order: int) -> int:
    """Return the order of the VARX (vector autoregression with inputs) that is fitted to data d.

    A VARX of order p with three outputs gives a state-space model of at most 3 p states. The order
    is the number of samples in `PAST_S` s, but at least ⌈``largest_order``/3⌉ + 2, so that
    ``largest_order`` states are possible. With few rows, the order is at most a 30th of their
    number, but not below 2.
    """
    rows = sum(len(u) for u, _ in d.data)
    want = max(round(PAST_S / d.interval_s), -(-largest_order // 3) + 2)
    return min(want, max(2, rows // 30))


def starts(d: Decimated, orders: Iterable[int]) -> dict[int, StateSpace]:
    """Return {order: model} for the data d by PBSID-opt; the order is the number of states.

    The models are the initial models of ``pem`` and ``oe``, and the results of ``pbsid``. Orders
    above three times the order of the VARX (`varx_order`) are left out.
    """
    orders = sorted(orders)
    p = varx_order(d, orders[-1])
    usable = [(u, y) for u, y in d.data if len(u) > p]
    fit = varx(usable, p)
    x = states(usable, fit, min(orders[-1], 3 * p))
    return {n: realise(usable, x, p, n) for n in orders if n <= x[0].shape[1]}


def refine(method: str, d: Decimated, start: StateSpace, *, dt: float, name: str) -> StateSpaceFit:
    """Return the fit of ``method`` to the data d, with the initial model ``start``.

    ``method`` is ``pem`` (prediction error), ``oe`` (output error) or ``pbsid`` (no further fit).
    The result contains the model called ``name``, resampled to dt (s). Raises NoContinuousModel if
    the fit cannot be resampled.
    """
    found = None
    model = start
    if method in ("pem", "oe"):
        oe = method == "oe"
        rho = 1 - 1e-6 if oe else float(np.exp(-d.interval_s / MEMORY_S))
        found = pem(d.data, start, output_error=oe, rho_max=rho)
        model = found.model
    u0, y0 = trims(model, d.u_mean, d.y_mean)
    fast = at_rate(model, d.interval_s, dt)
    linear = LinearModel(
        name=name,
        kind="oe" if method == "oe" else "statespace",
        A=fast.A,
        B=fast.B,
        C=fast.C,
        K=fast.K,
        S=fast.S,
        u0=u0,
        y0=y0,
        dt=dt,
    )
    return StateSpaceFit(linear, model, found, d.interval_s, d.u_mean, d.y_mean)


def selection_score(model: LinearModel, prepared: Prepared) -> float:
    """Return the score of ``model`` on the training runs (see the module); −∞ if not finite."""
    runs = prepared.train
    scores = [validation.score(validation.predictions(model, prepared, runs, SELECT_HORIZON_S))]
    if not validation.replay_obstacle(prepared, sorted({r.source for r in runs}), model):
        scores.append(validation.score(validation.replays(model, prepared, runs)))
    fit = np.array([s.fit_percent for s in scores])
    return float(fit.mean()) if np.isfinite(fit).all() else -np.inf


def search(
    method: str,
    prepared: Prepared,
    *,
    orders: Sequence[int] = ORDERS,
    intervals_s: Sequence[float] = INTERVALS_S,
    name: str = "black box",
) -> tuple[StateSpaceFit, list[CandidateOrder]]:
    """Fit all ``orders`` at all sampling intervals; return the chosen fit, and all candidates.

    The module explains the choice. ``method`` is ``pem``, ``oe`` or ``pbsid``. ``orders`` are
    numbers of states. Raises RecordingError if no candidate can be used.
    """
    tried: list[tuple[CandidateOrder, StateSpaceFit | None]] = []
    for interval_s in intervals_s:
        d = decimated(prepared, prepared.train, interval_s)
        rows = sum(len(u) for u, _ in d.data)
        try:
            initial = starts(d, orders)
        except ValueError as error:
            tried += [(CandidateOrder(n, d.interval_s, problem=str(error)), None) for n in orders]
            continue
        for n, start in initial.items():
            report_count("candidate models", len(tried), len(orders) * len(intervals_s))
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RuntimeWarning)
                try:
                    fit = refine(method, d, start, dt=prepared.dt, name=name)
                except NoContinuousModel as error:
                    problem = f"no continuous form: {error}"
                    tried.append((CandidateOrder(n, d.interval_s, problem=problem), None))
                    continue
                except np.linalg.LinAlgError as error:
                    problem = f"did not converge: {error}"
                    tried.append((CandidateOrder(n, d.interval_s, problem=problem), None))
                    continue
                value = selection_score(fit.model, prepared)
            logdet = float(np.linalg.slogdet(fit.state_space.S)[1])
            likelihood = -0.5 * rows * (logdet + 3 * np.log(2 * np.pi) + 3)
            free = n * (2 + 3 * (1 if method == "oe" else 2)) + 3
            bic = -2 * likelihood + free * np.log(rows)
            tried.append((CandidateOrder(n, d.interval_s, value, likelihood, bic), fit))
    usable = [(c, f) for c, f in tried if f is not None and np.isfinite(c.score)]
    if not usable:
        reasons = "; ".join(sorted({c.problem for c, _ in tried if c.problem})) or "none predicts"
        raise RecordingError(
            f"No {method} model can be fitted to these recordings ({reasons}).",
            cause="too little data or motion for this order.",
            fix="heli3dof run multisine for 60 s or more, or a lower order",
        )
    best = max(c.score for c, _ in usable)
    near = [(c, f) for c, f in usable if c.score >= best - SCORE_TOLERANCE]
    _, chosen = min(near, key=lambda cf: (cf[0].order, -cf[0].score))
    return chosen, [c for c, _ in tried]
