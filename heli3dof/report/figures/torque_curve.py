"""Compute a cause's figure: residual torque against the variable on which the cause depends.

The Kalman filter runs with the fitted model from which the cause is removed. Its noise intensities
are those of a refit without the cause. The filter gives the residual torque τ̂ (N·m,
`diagnosis.unmodelled.residual_torque`), which is averaged in bins of the variable. Samples within
`WINDOW_S` count as one, so the standard error of a bin's mean is

    σ = std(τ̂)/√max(T/`WINDOW_S`, 1)               T: time in the bin, s

The curve is the cause's torque τ (N·m). M is the mass matrix (kg·m²), q̈ the acceleration (rad/s²)
of the model with or without the cause, at the filter's states x:

    τ = M (q̈_with(x) − q̈_without(x))

An encoder error only changes the reading y of an angle q. For it, the filter runs once with each
model and gives the states x_with and x_without:

    τ = M (∂y/∂q q̈(x_with) − q̈(x_without))
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.unmodelled.residual_torque import (
    UNITS,
    LinearisedRun,
    along,
    linearised_run,
    linearised_run_at,
)
from heli3dof.diagnosis.unmodelled.unmodelled_torque import WINDOW_S, ResidualTorque
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.model.effects import Effect, Term
from heli3dof.model.parameter_units import torque_per
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.model.physics.state_layout import Stage

BINS = 24
"""Number of bins for the points; the curve has three times as many. Chosen; not derived."""
MIN_TIME_S = 0.1
"""s, least time in a bin; emptier bins are not drawn. Chosen; not derived."""
BACKLASH = "encoder.backlash"
"""An effect without a figure, because its torque is not a function of one variable"""
DELAYS = {"motor.lag": "voltage_difference_slope", "motor.delay": "voltage_difference_slope"}
"""Effects that delay the voltages V → variable of their figure. The torque of such an effect is
proportional to dV/dt, to first order in the delay."""

VOLTAGES = ("voltage_sum", "voltage_difference", "voltage_front", "voltage_back")
ALTERNATIVES = ("roll", "pitch", *VOLTAGES[:2])
"""Further variables that `_clearest` tries for an effect that depends on a voltage. The fitted trim
absorbs part of the torque of such an effect."""
ALTERNATIVES_OF = {
    **dict.fromkeys(VOLTAGES, ALTERNATIVES),
    "voltage_difference_slope": ("voltage_sum_slope",),
}
MIN_CLARITY_RATIO = 2.0
"""Ratio of clarities (`_clearest`) above which another variable replaces the best one. Chosen."""


@dataclass(frozen=True, eq=False)
class TorqueCurve:
    """Residual torque on ``axis`` in m bins of a variable, and the curve of the fitted cause."""

    name: str
    """Name of the cause"""
    axis: str
    depends_on: str
    unit: str
    """Unit of z and curve_z; degrees for angles"""
    z: np.ndarray
    torque: np.ndarray
    std: np.ndarray
    """(m,) each: variable, mean residual torque and its standard error, N·m"""
    curve_z: np.ndarray
    curve: np.ndarray
    """(c,) each: variable and the cause's torque, N·m. The torque is averaged in bins, because the
    cause may also depend on other variables"""


def variable_of(effect: Effect, axis: str | None) -> str | None:
    """Return the variable on the horizontal axis of an effect's figure; None for no figure."""
    if not effect.hooks or effect.name == BACKLASH:
        return None
    name = DELAYS.get(effect.name, effect.evidence).replace("{axis}", axis or "roll")
    return name if name in UNITS else None


def torque_curve(fit: Estimate, term: Term, noise: np.ndarray) -> TorqueCurve | None:
    """Return the data of the figure on the cause ``term`` of the model ``fit``.

    Returns None for an effect without a figure, or without usable rows. ``noise`` (4,): process
    noise of roll, pitch, yaw (rad/s²/√Hz) and sampling jitter (s), from a fit without the cause.
    """
    name = variable_of(term.effect, term.axis)
    if name is None:
        return None
    keep = tuple(t for t in fit.structure.terms if t.name != term.name)
    problem_without = replace(fit.problem, structure=Structure(fit.structure.profile, keep))
    parameters = dict(zip(fit.structure.names, fit.values.tolist(), strict=True))
    theta = problem_without.structure.scaled(problem_without.structure.values_of(parameters))
    flight = linearised_run_at(problem_without, theta, noise)
    is_encoder_error = Stage.MEASURE in term.effect.hooks
    if is_encoder_error:
        flight_with = linearised_run_at(fit.problem, fit.optimum.theta, fit.optimum.noise)
        q_ddot_with = flight_with.slope * flight_with.q_ddot
    else:
        q_ddot_with = along(fit.problem, fit.optimum.theta, flight.X)[3]
    cause = flight.as_torque(q_ddot_with - flight.q_ddot)
    if term.axis is not None and not is_encoder_error:
        i = AXES.index(term.axis)
    else:
        others = () if is_encoder_error else ALTERNATIVES_OF.get(name, ())
        name, i = _clearest(flight, cause, (name, *others))
    z = flight.variable(name)
    unit = UNITS[name]
    frequency = parameters.get(f"{term.name}.frequency_Hz")
    if name == "time" and frequency:
        z, name, unit = (z * frequency) % 1.0, f"phase of {frequency:.3g} Hz", "turns"
    rows = flight.in_runs & np.isfinite(flight.torque[:, i])
    if not rows.any():
        return None
    z = _in_unit(z, unit)[rows]
    curve_z, curve, _ = _binned(z, cause[rows, i], flight.data.h[rows], 3 * BINS)
    return TorqueCurve(
        term.name, AXES[i], name, unit,
        *_binned(z, flight.torque[rows, i], flight.data.h[rows], BINS), curve_z, curve,
    )  # fmt: skip


def residual_evidence(fit: Estimate, residual: ResidualTorque) -> TorqueCurve:
    """Return the data of the figure of ``residual``, a torque that ``fit`` does not explain."""
    flight = linearised_run(fit)
    i = AXES.index(residual.axis)
    rows = flight.in_runs & np.isfinite(flight.torque[:, i])
    unit = UNITS[residual.depends_on]
    z = _in_unit(flight.variable(residual.depends_on), unit)[rows]
    knots, torque = np.array(residual.table).T
    slope = float(np.polyfit(_in_unit(knots, unit), torque, 1)[0])
    name = f"Unmodelled {residual.axis} torque, slope {slope:.3g} {torque_per(unit)},"
    name = name.replace("-", "−")
    return TorqueCurve(
        name, residual.axis, residual.depends_on, unit,
        *_binned(z, flight.torque[rows, i], flight.data.h[rows], BINS),
        _in_unit(knots, unit), torque,
    )  # fmt: skip


def _clearest(flight: LinearisedRun, cause: np.ndarray, names: Sequence[str]) -> tuple[str, int]:
    """Return the variable and axis (0 to 2) for which the cause explains most residual torque.

    ``cause`` (N, 3): the cause's torque τ in N·m; ``names``: the variables to compare. τ and the
    residual torque τ̂ of ``flight`` are averaged in bins of the variable. S(x) is the sum over the
    bins of the squared deviation of x from its weighted mean; each weight is 1/σ², σ the standard
    error of τ̂ in the bin. The clarity is S(τ̂) − S(τ̂ − τ). Another variable
    replaces the best one so far if its clarity is more than `MIN_CLARITY_RATIO` times as large.
    """
    best = (names[0], 0, 0.0)
    for name in dict.fromkeys(names):
        z = flight.variable(name)
        for i in range(3):
            rows = flight.in_runs & np.isfinite(flight.torque[:, i])
            if not rows.any():
                continue
            h = flight.data.h[rows]
            _, mean, _ = _binned(z[rows], cause[rows, i], h, BINS)
            _, torque, std = _binned(z[rows], flight.torque[rows, i], h, BINS)
            weight = 1 / np.maximum(std, 1e-12) ** 2
            clarity = _squares_about_mean(torque, weight) - _squares_about_mean(
                torque - mean, weight
            )
            if clarity > best[2] * (1.0 if name == best[0] else MIN_CLARITY_RATIO):
                best = (name, i, clarity)
    return best[0], best[1]


def _squares_about_mean(x: np.ndarray, weight: np.ndarray) -> float:
    return float(np.sum(weight * (x - np.average(x, weights=weight)) ** 2))


def _binned(
    z: np.ndarray, torque: np.ndarray, h: np.ndarray, bins: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the means of z and torque, and the torque's standard error, in bins of z.

    The bins are of equal width, between the quantiles 0.002 and 0.998 of the variable z. Bins
    with data of less than `MIN_TIME_S` s are omitted. ``h`` (N,): sampling intervals in s.
    """
    low, high = np.quantile(z, [0.002, 0.998])
    which = np.clip(((z - low) / max(high - low, 1e-12) * bins).astype(int), 0, bins - 1)
    time = np.bincount(which, h, bins)
    count = np.maximum(np.bincount(which, minlength=bins), 1)
    mean = np.bincount(which, torque, bins) / count
    scatter = np.sqrt(np.bincount(which, (torque - mean[which]) ** 2, bins) / count)
    at = np.bincount(which, z, bins) / count
    kept = time >= MIN_TIME_S
    return at[kept], mean[kept], (scatter / np.sqrt(np.maximum(time / WINDOW_S, 1.0)))[kept]


def _in_unit(z: np.ndarray, unit: str) -> np.ndarray:
    """Return z (SI) in ``unit``: angles and rates in degrees, others unchanged."""
    return np.degrees(z) if unit.startswith("°") else np.asarray(z)
