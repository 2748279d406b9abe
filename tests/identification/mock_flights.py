"""Flights of the emulated rig for tests of identification.

The rig hides effects of real rigs: a rotor lag of 0.1 s, a pendulum on roll and pitch, viscous
friction on every axis. Process noise and encoders are the mock's own.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from heli3dof.recording.recording import Recording
from tests.flown import flown

HIDDEN = (
    "motor.lag:0.1,stiffness.pendulum.roll:0.9,stiffness.pendulum.pitch:0.02,"
    "friction.viscous.roll:0.05,friction.viscous.pitch:0.012,friction.viscous.yaw:0.08"
)
PLANS = ("multisine", "steps", "large")


@lru_cache(maxsize=32)
def mock_flight(plan: str, seed: int, *, noise: float = 1.0) -> Recording:
    """A whole flight of a named plan, from the table and back, on the rig of `HIDDEN`."""
    device = f"mock:?speed=max&seed={seed}&noise={noise:g}&hide={HIDDEN}"
    return flown(plan, device=device, seed=seed, meta={"name": f"{plan}-{seed}"})


def truth_replay(plan: str, seed: int, start: int) -> np.ndarray:
    """(3,) fit %: the rig itself, flown again without its noise, against the noisy flight.

    Over rows from ``start`` to 4 s before the end, where both land.
    """
    noisy, quiet = mock_flight(plan, seed), mock_flight(plan, seed, noise=0)
    stop = min(len(noisy), len(quiet)) - round(4.0 / noisy.dt)
    y, replayed = noisy.angle[start:stop], quiet.angle[start:stop]
    size = np.linalg.norm(y - y.mean(axis=0), axis=0)
    return np.asarray(100 * (1 - np.linalg.norm(y - replayed, axis=0) / size))
