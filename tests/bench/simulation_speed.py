"""Measures how many times faster than real time the hover loop is simulated."""

from __future__ import annotations

import time

import numpy as np

from heli3dof.model.base import LoopTask
from heli3dof.model.linear.closed_loop import fly
from heli3dof.model.linear.hover import hover_model
from heli3dof.rig.profile import default_profile


def simulation_speed(duration_s: float = 600.0, repeats: int = 5) -> float:
    """Returns simulated s per s for the hover loop at 500 Hz, the best of ``repeats`` runs.

    One run is a 10° roll square wave with quantised encoders, on one thread, after compilation.
    """
    profile = default_profile()
    assert profile.controller is not None
    N = round(duration_s / profile.dt)
    reference = np.zeros((N, 3))
    reference[:, 0] = np.deg2rad(10) * (np.arange(N) * profile.dt % 20 < 10)
    task = LoopTask(
        reference, np.zeros((N, 2)), np.zeros(3), profile.controller, profile.motor.V_o,
        profile.motor.v_max, profile.dt, profile.encoder.rad_per_count,
    )  # fmt: skip
    model = hover_model(profile)
    fly(model, task)
    best = np.inf
    for _ in range(repeats):
        start = time.perf_counter()
        fly(model, task)
        best = min(best, time.perf_counter() - start)
    return float(duration_s / best)
