"""Noise floors of flights with white and with coloured torque noise. Seed 1911."""

from __future__ import annotations

import numpy as np
import pytest

from heli3dof.diagnosis.validation.simulation_error import coloured_variance, simulation_error
from heli3dof.identification.greybox.method import fit_greybox, model_of
from tests.flown import flown
from tests.profiles import profile

PITCH = 1


@pytest.mark.parametrize(("noise_s", "white_share"), [(0.01, 0.9), (0.3, 0.6)])
def test_a_true_model_s_error_is_the_noise_floor_whatever_the_noise_s_correlation(
    noise_s: float, white_share: float
) -> None:
    device = f"mock:?speed=max&start=level&seed=1911&noise_s={noise_s}"
    flight = flown("rich", 40.0, device=device, seed=1911, profile=profile(rate_hz=250.0))
    model = model_of(fit_greybox(flight, ()), [flight], "fitted")
    rmse, floor = simulation_error(model, [flight]).at(1.0, "pitch")
    assert floor == pytest.approx(rmse, rel=0.2)
    added = np.degrees(np.sqrt(coloured_variance(model, [flight], (1.0,))[0, PITCH]))
    assert np.sqrt(floor**2 - added**2) == pytest.approx(white_share * rmse, rel=0.2)
