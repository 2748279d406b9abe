"""Noise floors of flights with white and with coloured torque noise. Seeds 1911 to 1916."""

from __future__ import annotations

import pytest

from heli3dof.diagnosis.validation import simulation_error as validation
from heli3dof.diagnosis.validation.simulation_error import noise_floor_deg, simulation_error
from heli3dof.identification.greybox.method import fit_greybox, model_of
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.recording.recording import Recording
from tests.flown import flown
from tests.profiles import profile

ONE_S, PITCH = validation.HORIZONS_S.index(1.0), 1


def fitted(seed: int, noise_s: float) -> tuple[Recording, GreyBoxModel]:
    device = f"mock:?speed=max&start=level&seed={seed}&noise_s={noise_s}"
    flight = flown("rich", 40.0, device=device, seed=seed, profile=profile(rate_hz=250.0))
    return flight, model_of(fit_greybox(flight, ()), [flight], "fitted")


@pytest.mark.parametrize(("noise_s", "white_share"), [(0.01, 0.9), (0.3, 0.6)])
def test_a_true_model_s_error_is_the_noise_floor_whatever_the_noise_s_correlation(
    noise_s: float, white_share: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    flight, model = fitted(1911, noise_s)
    rmse, floor = simulation_error(model, [flight]).at(1.0, "pitch")
    assert floor == pytest.approx(rmse, rel=0.2)
    monkeypatch.setattr(validation, "coloured_variance", lambda *args: 0.0)
    white = noise_floor_deg(model, [flight])[0][ONE_S, PITCH]
    assert white == pytest.approx(white_share * rmse, rel=0.2)
