"""The size of an effect that the emulated rig hides, from a full fit; seeds from 1000 on.

Torques are compared in units of the profile's K_f, which is the rig's too without spread.
"""

from __future__ import annotations

from functools import lru_cache

import pytest

from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.method import fit_greybox
from tests.flown import flown


@lru_cache(maxsize=4)
def fitted(name: str, size: float, seed: int = 1021, until_s: float = 40.0) -> Estimate:
    device = f"mock:?speed=max&seed={seed}&hide={name}:{size:g}"
    return fit_greybox(flown("rich", until_s, device=device, seed=seed), (name,))


@pytest.mark.accuracy
@pytest.mark.parametrize(
    ("name", "size", "share"),
    [
        ("friction.coulomb.yaw", 0.06, 0.03),
        ("friction.coulomb.pitch", 0.01, 0.03),
        ("encoder.backlash.pitch", 0.5, 0.03),
        ("encoder.backlash.yaw", 0.8, 0.05),
        ("motor.dead_zone", 1.5, 0.15),
    ],
)
def test_the_fitted_size_of_a_hidden_effect_is_right(name: str, size: float, share: float) -> None:
    result = fitted(name, size)
    assert result.optimum.converged
    assert result.values[-1] == pytest.approx(size, rel=share)
    assert abs(result.values[-1] - size) < 3.5 * result.std[-1]


@pytest.mark.accuracy
def test_an_encoder_scale_is_not_confused_with_an_inertia() -> None:
    result = fitted("encoder.scale.roll", 0.9)
    assert result.optimum.converged
    assert result.values[-1] == pytest.approx(0.9, abs=0.02)
