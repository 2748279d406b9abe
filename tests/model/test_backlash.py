"""The play of an encoder: where it was left in flight, and by its flanks in the filter."""

from __future__ import annotations

import numpy as np
import pytest

from heli3dof.model.effects import terms
from heli3dof.model.greybox.linearisation import true_angles
from heli3dof.model.greybox.model import nominal
from heli3dof.model.physics import state_layout
from heli3dof.model.physics.integrator import flanks, readings
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.rig.profile import default_profile

NAME = "encoder.backlash.pitch"
HALF = np.radians(0.25)


def rig(angle_deg: float = 0.5):  # type: ignore[no-untyped-def]
    structure = Structure(default_profile(), terms((NAME,)))
    return structure.arguments(structure.values_of({f"{NAME}.angle_deg": angle_deg}))


def test_in_flight_the_encoder_stays_until_the_other_flank_carries_it() -> None:
    s, *effects = rig()
    s[state_layout.FLANK : state_layout.FLANK + 3] = 2.0
    m, slope, read = np.empty(3), np.empty(3), []
    way = np.radians([0.0, 1.0, 0.8, 0.4, 0.0, -1.0, -0.9])
    for p in way:
        x = np.array([0, p, 0, 0, 0, 0.0])
        readings(s, x, *effects, m, slope)
        read.append(m[1])
    #  up to 1° it is carried to 0.75°; back to 0.5° nothing; then it lags 0.25° the other way
    np.testing.assert_allclose(np.degrees(read), [0, 0.75, 0.75, 0.65, 0.25, -0.75, -0.75])


def test_the_filter_reads_half_the_play_less_rising_and_more_falling() -> None:
    s, *effects = rig()
    x = np.array([0, 0.1, 0, 0, 0, 0.0])
    work = np.empty(3), np.empty(3)
    rising, falling, slope = flanks(s, x, 1, *effects, *work)
    assert (rising, falling) == pytest.approx((0.1 - HALF, 0.1 + HALF))
    assert slope == pytest.approx(1.0)
    assert not effects[-1].any()  # nothing was remembered


def test_a_play_does_not_shift_the_angle_that_a_resting_encoder_stands_for() -> None:
    model = nominal(default_profile(), (NAME,), **{f"{NAME}.angle_deg": 0.5})
    np.testing.assert_allclose(true_angles(model, np.array([0.0, 0.1, 0.2])), [0.0, 0.1, 0.2])
