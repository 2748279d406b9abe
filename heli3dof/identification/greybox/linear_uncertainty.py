"""Poles, transfer functions and frequency responses of a physical fit, with standard deviations.

The model is linearised about hover, without the effects that are `PhysicalFit.absent`. A pole, a
coefficient or a response f has the covariance F P Fᵀ, with the covariance P of the parameters θ and
F = ∂f/∂θ by differences. `innovations` computes the errors for the residual tests. `fit_result`
collects all results in a `FitResult`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from heli3dof.identification.fit_result import (
    FitResult,
    Innovations,
    Parameter,
    Pole,
    rightmost_first,
)
from heli3dof.identification.greybox.physical_fit import PhysicalFit
from heli3dof.identification.greybox.thrust_scale import thrust_gain_warning
from heli3dof.identification.preprocessing import Prepared
from heli3dof.identification.transfer_function import TransferFunctions
from heli3dof.model.discretisation import Continuous, numerators
from heli3dof.model.estimation.filter_data import RowRange
from heli3dof.model.greybox.model import GreyBoxModel

TEST_INTERVAL_S = 0.04
"""s: prediction horizon in residual tests; one sample ahead, most of an error is rounding."""
STEP = 1e-2
"""Step of the finite differences, as a share of each parameter's standard deviation"""


def linear_quantities(
    found: PhysicalFit, model: GreyBoxModel, dt: float
) -> tuple[
    tuple[Pole, ...],
    TransferFunctions,
    Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
]:
    """Return poles, transfer functions and frequency response of a fitted model at hover.

    The third result is a function: frequencies ω (F,) rad/s → response (F, 3, 2) rad/V, and its
    standard deviation. ``dt`` (s) is the control period.
    """
    theta = found.theta
    sd = found.std / found.slopes
    cov = found.covariance / np.outer(found.slopes, found.slopes)
    absent, null = found.absent, np.array([f.null for f in found.free])

    def at(point: np.ndarray) -> Continuous:
        values = np.where(absent, null, found.structure.unscaled(point))
        return replace(model, values=values).linear(dt).continuous()

    here = at(theta)
    steps = STEP * np.minimum(sd, 1.0)
    moved = [at(theta + np.eye(len(theta))[j] * e) for j, e in enumerate(steps)]
    p0 = np.linalg.eigvals(here.A)

    def nearest(A: np.ndarray) -> np.ndarray:
        p = list(np.linalg.eigvals(A))
        return np.array([p.pop(int(np.argmin(np.abs(np.array(p) - z)))) for z in p0])

    def std(slope: np.ndarray) -> float:
        return float(np.sqrt(max(float(slope @ cov @ slope), 0)))

    slopes = np.array([(nearest(c.A) - p0) / e for c, e in zip(moved, steps, strict=True)]).T
    poles = [Pole(complex(z), std(s.real), std(s.imag)) for z, s in zip(p0, slopes, strict=True)]

    c0 = here.coefficients()
    T = np.array([(c.coefficients() - c0) / e for c, e in zip(moved, steps, strict=True)]).T
    num, den = numerators(here)

    response = partial(_response, here, moved, steps, cov)  # unlike a closure, it can be pickled
    return rightmost_first(poles), TransferFunctions(num, den, T @ cov @ T.T), response


def _response(
    here: Continuous,
    moved: Sequence[Continuous],
    steps: np.ndarray,
    cov: np.ndarray,
    omega: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the frequency response (F, 3, 2) of the model ``here`` in rad/V, and its std.

    ``omega`` (F,) are the frequencies in rad/s. The standard deviation follows from the covariance
    ``cov`` (n, n) of the scaled parameters by numerical derivatives. Each of the n models ``moved``
    differs from ``here`` in one parameter, by the step for this parameter in ``steps`` (n,).
    """
    G0 = here.response(omega)
    dG = np.array([(c.response(omega) - G0) / e for c, e in zip(moved, steps, strict=True)])
    var = np.einsum("iabc,ij,jabc->abc", dG.real, cov, dG.real)
    var += np.einsum("iabc,ij,jabc->abc", dG.imag, cov, dG.imag)
    return G0, np.sqrt(np.maximum(var, 0))


def innovations(model: GreyBoxModel, prepared: Prepared, runs: Sequence[RowRange]) -> Innovations:
    """Return each run's prediction errors (rad) and mean voltages (V), every `TEST_INTERVAL_S` s.

    Predictions are `TEST_INTERVAL_S` ahead; the voltages are means over the predicted interval.
    """
    q = max(1, round(TEST_INTERVAL_S / prepared.dt))
    E, U = [], []
    for run in runs:
        part = prepared.recordings[run.source].rows(slice(run.start, run.stop))
        n = (len(part) - 1) // q
        if n < 2:
            continue
        rows = q * np.arange(1, n + 1)
        E.append((part.angle - model.predict(part, q * part.dt))[rows])
        U.append(part.voltage[: n * q].reshape(n, q, 2).mean(axis=1))
    return E, U


def fit_result(
    found: PhysicalFit,
    model: GreyBoxModel,
    dt: float,
    *,
    parameters: Mapping[str, Parameter],
    warnings: tuple[str, ...],
    notes: tuple[str, ...] = (),
) -> FitResult:
    """Return a physical fit and its ``model`` as a `FitResult`; ``dt`` (s): control period."""
    poles, transfer, response = linear_quantities(found, model, dt)
    return FitResult(
        model=model,
        order=len(poles),
        interval_s=dt,
        innovations=partial(innovations, model),
        poles=poles,
        transfer=transfer,
        parameters=parameters,
        warnings=(*thrust_gain_warning(found), *warnings),
        notes=notes,
        response=response,
        test_interval_s=TEST_INTERVAL_S,
        correlation=found.correlation,
    )
