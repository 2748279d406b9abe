"""Simulated flights of recordings with holes."""

from __future__ import annotations

import numpy as np

from heli3dof.identification.bias_correction.simulated_flight import simulated_flight
from heli3dof.model.greybox.model import nominal
from tests.flown import flown


def test_the_simulated_loop_goes_on_during_a_hole() -> None:
    r = flown("steps", 20.0, device="mock:?speed=max")
    cut = r.rows((r.t < 8.0) | (r.t >= 14.0))
    simulated = simulated_flight(nominal(r.profile), cut, np.random.default_rng(1))
    # References are held in the hole, so a step there comes late: by up to its 10°.
    assert np.abs(simulated.angle - cut.angle)[simulated.t > 14.0].max() < np.radians(15)
