"""Fit state-space black boxes by ``pem``, ``pbsid`` or ``oe``; a search chooses the order.

``pem`` minimises prediction errors, ``oe`` simulation errors; ``pbsid`` is a subspace method.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from heli3dof.identification.black_box.one_step_predictor import filter_states
from heli3dof.identification.black_box.order_selection import (
    ORDERS,
    StateSpaceFit,
    search,
)
from heli3dof.identification.black_box.stabilisation import with_stable_predictor
from heli3dof.identification.black_box.uncertainty import (
    continuous_pole,
    in_continuous_time,
    poles,
    propagate,
    response_std,
)
from heli3dof.identification.fit_result import (
    FitResult,
    Innovations,
    Pole,
    Request,
    rightmost_first,
)
from heli3dof.identification.preprocessing import Prepared, segments
from heli3dof.identification.transfer_function import TransferFunctions
from heli3dof.model.discretisation import numerators
from heli3dof.model.estimation.filter_data import RowRange

OPEN_RHO = 1 - 1e-6


def fit(prepared: Prepared, request: Request) -> FitResult:
    """Fit a black box to the training runs by the method and order that ``request`` names."""
    orders = ORDERS if request.order is None else (request.order,)
    chosen, tried = search(
        request.method, prepared, orders=orders, intervals_s=request.intervals_s, name=request.name
    )
    T = chosen.interval_s
    num, den = numerators(in_continuous_time(chosen.state_space, T))
    covariance = None
    warnings = []
    if chosen.pem is None:
        lam = np.linalg.eigvals(chosen.state_space.A).astype(complex)
        found = [Pole(continuous_pole(z, T), np.nan, np.nan) for z in lam]
        warnings.append("PBSID gives no standard deviations; pem, which starts from it, does.")
    else:
        if not chosen.pem.converged:
            warnings.append(
                f"The fit had not converged after {chosen.pem.iterations} steps; use more data or "
                "a lower order."
            )
        found = poles(chosen.pem, T)
        covariance = propagate(chosen.pem, lambda m: in_continuous_time(m, T).coefficients())
    return FitResult(
        model=chosen.model,
        order=chosen.model.order,
        interval_s=T,
        innovations=partial(innovations, chosen),
        poles=rightmost_first(found),
        transfer=TransferFunctions(num, den, covariance),
        candidates=tuple(tried),
        warnings=tuple(warnings),
        response=partial(_response, chosen),
    )


def _response(chosen: StateSpaceFit, omega: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    G = in_continuous_time(chosen.state_space, chosen.interval_s).response(omega)
    if chosen.pem is None:
        return G, np.full(G.shape, np.nan)
    return G, response_std(chosen.pem, chosen.interval_s, omega)


def innovations(chosen: StateSpaceFit, prepared: Prepared, runs: Sequence[RowRange]) -> Innovations:
    """Return each run's one-step prediction errors (rad), and voltages minus ``chosen.u_mean`` (V).

    For the method ``oe``, the errors are those of a simulation. The data are decimated to the
    sampling interval of ``chosen``.
    """
    ss = chosen.state_space
    if ss.K.any():
        ss = with_stable_predictor(ss, rho=OPEN_RHO)
    At, B, K = (np.ascontiguousarray(a) for a in (ss.At, ss.B, ss.K))
    E, U = [], []
    for u, y in segments(prepared, runs, round(chosen.interval_s / prepared.dt)):
        u1, y1 = np.ascontiguousarray(u - chosen.u_mean), np.ascontiguousarray(y - chosen.y_mean)
        x = filter_states(At, B, K, u1, y1, np.zeros(ss.order))
        E.append(y1 - x @ ss.C.T - ss.d)
        U.append(u1)
    return E, U
