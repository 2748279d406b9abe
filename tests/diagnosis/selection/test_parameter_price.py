"""A parameter costs ln N if the data determine it, and nothing if only its prior does."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from heli3dof.diagnosis.selection.parameter_price import price

N = 20000
INFLOW, LAG = "aero.inflow", "motor.lag"


def at(prior: list[float], information: list[float], *names: str) -> tuple[Any, Any]:
    """Return a problem and a fit with two parameters of the inflow, or those of ``names``."""
    problem = SimpleNamespace(
        structure=SimpleNamespace(free=[SimpleNamespace(term=t) for t in names or [INFLOW] * 2]),
        prior_precision=np.array(prior),
    )
    fit = SimpleNamespace(information=np.diag(information), at=SimpleNamespace(row=np.arange(N)))
    return problem, fit


def test_a_first_parameter_costs_ln_n() -> None:
    assert price(*at([1e-4], [50.0], LAG), "motor.lag") == pytest.approx(np.log(N))


def test_a_second_parameter_without_information_costs_nothing() -> None:
    assert price(*at([1e-4, 4.0], [50.0, 0.0]), "aero.inflow") == pytest.approx(np.log(N))


def test_a_second_parameter_costs_the_shrinkage_of_its_prior() -> None:
    """Prior deviation 0.5, posterior 0.5/3: the variance is a ninth, ln 9 = 2.197."""
    cost = price(*at([1e-4, 4.0], [50.0, 32.0]), "aero.inflow")
    assert cost - np.log(N) == pytest.approx(2.197, abs=1e-3)


def test_an_inflation_of_two_halves_the_information() -> None:
    once = price(*at([1e-4, 4.0], [50.0, 32.0]), "aero.inflow")
    assert price(*at([1e-4, 4.0], [100.0, 64.0]), "aero.inflow", 2.0) == pytest.approx(once)


def test_no_parameter_costs_more_than_ln_n() -> None:
    sharp = price(*at([1e-4, 1e-6], [50.0, 1e9]), "aero.inflow")
    assert sharp == pytest.approx(2 * np.log(N))
