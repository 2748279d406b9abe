"""`LinearModel`: what it says of itself, and which sample intervals it serves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.errors import RecordingError
from heli3dof.model.linear.hover import hover_model
from tests.model.examples import PROFILE, in_another_basis

HOVER = hover_model(PROFILE)


def test_an_axis_is_modelled_where_its_row_of_C_says_something() -> None:
    C = HOVER.C.copy()
    C[0], C[1] = np.nan, 0.0
    assert replace(HOVER, C=C).modelled.tolist() == [False, False, True]
    assert replace(HOVER, C=C).axes == ("yaw",)
    assert HOVER.axes == ("roll", "pitch", "yaw")


def test_the_hover_models_state_is_physical_and_an_identified_models_is_not() -> None:
    assert HOVER.physical_state
    assert not in_another_basis(HOVER).physical_state
    assert not replace(HOVER, exact_hold=False).physical_state


def test_at_its_own_interval_a_model_is_itself() -> None:
    assert HOVER.at(0.002) is HOVER


def test_a_model_of_continuous_origin_is_discretised_anew() -> None:
    np.testing.assert_allclose(HOVER.at(0.005).A, hover_model(PROFILE, dt=0.005).A, atol=1e-12)
    np.testing.assert_allclose(HOVER.at(0.005).B, hover_model(PROFILE, dt=0.005).B, atol=1e-12)


def test_an_identified_model_serves_its_own_interval_to_one_percent() -> None:
    identified = replace(HOVER, exact_hold=False)
    assert identified.at(0.002 * 1.009) is identified
    with pytest.raises(RecordingError, match=r"not every 2\.03 ms"):
        identified.at(0.00203)
