"""Eq (17) as data."""

from __future__ import annotations

import numpy as np
import pytest

from heli3dof.model.control.closed_loop_poles import rightmost_first
from heli3dof.paper.eq17 import DENOMINATOR, numerators_deg, paper17_model
from heli3dof.paper.models import BUILT_IN
from tests.model.examples import DEG, PROFILE


def poles() -> np.ndarray:
    """Return the four poles of eq (17) in rad/s, rightmost first."""
    return rightmost_first(np.roots(DENOMINATOR))


def dc_gains_deg() -> np.ndarray:
    """Return the DC gains of eq (17) in °/V, (2, 3): motor, angle.

    The correction of T_11 does not change them.
    """
    return numerators_deg()[:, :, -1] / DENOMINATOR[-1]


def test_poles_are_the_golden_four() -> None:
    golden = [-0.3377 + 1.0671j, -0.3377 - 1.0671j, -0.3518 + 0.3978j, -0.3518 - 0.3978j]
    assert poles().round(4).tolist() == golden


def test_dc_gains_are_the_golden_six_degrees_per_volt() -> None:
    gains = dc_gains_deg()
    assert gains[0].round(2).tolist() == [11.29, 0, 0]
    assert round(gains[1, 0], 2) == -10.91
    assert gains[1, 1:].round(3).tolist() == [-0.889, -2.963]


@pytest.mark.parametrize("corrected", [False, True])
def test_the_model_has_those_gains_and_poles_in_radians(corrected: bool) -> None:
    m = paper17_model(PROFILE, corrected=corrected)
    gain = m.C @ np.linalg.solve(np.eye(8) - m.A, m.B) / DEG
    np.testing.assert_allclose(gain.T, dc_gains_deg(), atol=1e-8)
    np.testing.assert_allclose(
        np.sort_complex(np.log(np.linalg.eigvals(m.A)) / m.dt),
        np.sort_complex(np.concatenate([poles(), poles()])),
        atol=1e-5,
    )


def test_the_two_readings_differ_in_one_coefficient() -> None:
    difference = numerators_deg() - numerators_deg(corrected=True)
    assert np.argwhere(difference).tolist() == [[0, 0, 0]]
    assert numerators_deg()[0, 0, 0] == 52.0
    assert numerators_deg(corrected=True)[0, 0, 0] == 2.52


def test_it_says_that_it_is_defective_and_is_not_the_default() -> None:
    assert "E14" in paper17_model(PROFILE).extra["defective"]
    assert next(iter(BUILT_IN)) == "hover"
