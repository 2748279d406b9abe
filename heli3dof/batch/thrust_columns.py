"""Columns of the table that combine parameters of a grey-box model.

- ``thrust_gain_ratio``: g, the ratio of the rig's thrust gain to the profile's value K_f. The
  identification keeps K_f fixed. So on a rig with the thrust gain g·K_f, its estimates of the
  inertias J are J/g. ln g is the generalised least-squares mean of ln(J_nominal/Ĵ) over the three
  axes, with the covariance of the estimated inertias Ĵ.
- ``hover_voltage_V``: the voltage per motor at level hover, of the model with its effects.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from heli3dof.axes import AXES

INERTIAS = tuple(f"J_{axis}" for axis in AXES)


def thrust_columns(
    parameters: Mapping[str, Mapping[str, Any]],
    correlation: Sequence[Any] | None,
    hover: Mapping[str, float] | None,
) -> dict[str, float]:
    """Return four columns: thrust gain ratio and hover voltage, each with standard deviation.

    The thrust gain ratio is the rig's thrust gain, divided by the profile's thrust gain.
    ``parameters``: {name: estimate} of the model's parameters; ``correlation``: their correlation
    matrix; ``hover``: ``value`` and ``std`` (V) of the hover voltage, or None.

    The two columns of the thrust gain ratio are left out if an inertia or the correlation matrix is
    missing. The two columns of the hover voltage are left out if ``hover`` is None.
    """
    voltage = {} if hover is None else {
        "hover_voltage_V": hover["value"], "hover_voltage_V_std": hover["std"],
    }  # fmt: skip
    if not correlation or any(n not in parameters for n in INERTIAS):
        return voltage
    names = list(parameters)
    at = [names.index(n) for n in INERTIAS]
    J, std, nominal = (
        np.array([parameters[n][key] for n in INERTIAS], float)
        for key in ("value", "std", "nominal")
    )
    s = std / J
    covariance = np.array(correlation, float)[np.ix_(at, at)] * np.outer(s, s)
    ln_gain, ln_std = generalised_mean(np.log(nominal / J), covariance)
    return {
        "thrust_gain_ratio": math.exp(ln_gain),
        "thrust_gain_ratio_std": math.exp(ln_gain) * ln_std,
        **voltage,
    }


def generalised_mean(x: np.ndarray, covariance: np.ndarray) -> tuple[float, float]:
    """Return the generalised least-squares mean (1ᵀΣ⁻¹x)/(1ᵀΣ⁻¹1) and its standard deviation.

    ``x`` (n,): the values; ``covariance`` (n, n): their covariance Σ. Both results are NaN if Σ is
    singular or 1ᵀΣ⁻¹1 is not positive.
    """
    try:
        weight = np.linalg.solve(covariance, np.ones(len(x)))
    except np.linalg.LinAlgError:
        return math.nan, math.nan
    total = float(weight.sum())
    if not total > 0:
        return math.nan, math.nan
    return float(weight @ x) / total, total**-0.5
