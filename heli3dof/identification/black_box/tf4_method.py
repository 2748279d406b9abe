"""Method ``tf4``: six transfer functions over one fourth-order denominator, the paper's eq (17).

`heli3dof.identification.black_box.tf4` does the fit; `fit` makes a `LinearModel` of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from heli3dof.errors import UsageError
from heli3dof.identification.black_box.one_step_predictor import filter_states, free_responses
from heli3dof.identification.black_box.order_selection import decimated
from heli3dof.identification.black_box.tf4 import fit_tf4, state_space
from heli3dof.identification.fit_result import (
    FitResult,
    Innovations,
    Pole,
    Request,
    rightmost_first,
)
from heli3dof.identification.preprocessing import Prepared, segments
from heli3dof.model.estimation.filter_data import RowRange
from heli3dof.model.linear.model import LinearModel

INTERVAL_S = 0.04
FOURTH_ORDER = (
    "Fourth order is too low for this plant, which has at least six states and an integrator in "
    "yaw (erratum E14 of the paper)."
)


def fit(prepared: Prepared, request: Request) -> FitResult:
    """Fit fourth-order transfer functions to the training runs of ``prepared``.

    Raises UsageError if ``request.order`` is neither None nor 4.
    """
    if request.order not in (None, 4):
        raise UsageError(
            f"tf4 has order 4, not {request.order}.",
            cause="it is the paper's form, eq (17), with a fourth-order denominator.",
            fix=f"method='pem', order={request.order}",
        )
    d = decimated(prepared, prepared.train, INTERVAL_S)
    transfer, offset, S = fit_tf4(d.data, d.interval_s)
    A, B, C = state_space(transfer, prepared.dt)
    model = LinearModel(
        name=request.name,
        kind="tf4",
        A=A,
        B=B,
        C=C,
        K=np.zeros((len(A), 3)),
        S=S,
        u0=d.u_mean,
        y0=d.y_mean + offset,
        dt=prepared.dt,
        exact_hold=True,
    )
    den, cov = transfer.den, transfer.covariance
    assert cov is not None
    found = []
    for s in np.roots(den):
        # D(s) = 0: ∂s = −Σ s^{4−k} ∂d_k / D′(s)
        g = -(s ** np.arange(3, -1, -1)) / np.polyval(np.polyder(den), s)
        std = [float(np.sqrt(max(part @ cov[:4, :4] @ part, 0))) for part in (g.real, g.imag)]
        found.append(Pole(complex(s), *std))
    return FitResult(
        model=model,
        order=4,
        interval_s=d.interval_s,
        innovations=partial(simulation_errors, model, interval_s=d.interval_s),
        poles=rightmost_first(found),
        transfer=transfer,
        warnings=(FOURTH_ORDER,),
        response=transfer.response,
    )


def simulation_errors(
    model: LinearModel, prepared: Prepared, runs: Sequence[RowRange], interval_s: float
) -> Innovations:
    """Return two lists, each with an array per run: simulation errors (rad), and voltages (V).

    The voltages are deviations from the model's trim voltages. ``runs`` are row ranges of the
    recordings in ``prepared``. The function decimates these rows to the interval ``interval_s``
    (s). Each run is simulated from the initial state that fits it best.
    """
    at = model.at(interval_s)
    A, B, C = (np.ascontiguousarray(a) for a in (at.A, at.B, at.C))
    none = np.zeros((len(A), 3))
    E, U = [], []
    for u, y in segments(prepared, runs, round(interval_s / prepared.dt)):
        u1, y1 = np.ascontiguousarray(u - at.u0), y - at.y0
        e = y1 - filter_states(A, B, none, u1, np.ascontiguousarray(y1), np.zeros(len(A))) @ C.T
        O = free_responses(A, C, len(u1)).reshape(-1, len(A))
        x0 = np.linalg.lstsq(O, e.ravel(), rcond=1e-10)[0]
        E.append(e - (O @ x0).reshape(e.shape))
        U.append(u1)
    return E, U
