"""Measures the speed of simulation, controller and prediction."""

from __future__ import annotations

import time

import numpy as np

from heli3dof.model.base import LoopTask
from heli3dof.model.control.controller import Controller
from heli3dof.model.linear.closed_loop import fly
from heli3dof.model.linear.hover import hover_model
from heli3dof.model.linear.prediction import predict
from heli3dof.recording.recording import recording_of_arrays
from heli3dof.rig.profile import default_profile
from tests.bench import Figure, at_least, at_most
from tests.bench.simulation_speed import simulation_speed

TITLE = "The model"


def tick_us() -> float:
    """Returns µs per call of the controller in plain Python, the best of 20 batches."""
    c = Controller.of(default_profile())
    angle = np.array([0.01, 0.02, 0.03])
    best = np.inf
    for _ in range(20):
        start = time.perf_counter()
        for _ in range(1000):
            c.step(angle, angle)
        best = min(best, (time.perf_counter() - start) / 1000)
    return float(best * 1e6)


def predict_s() -> float:
    """Returns s to predict 60 s at 500 Hz one second ahead by the hover model, the best of 3."""
    profile = default_profile().with_controller()
    assert profile.controller is not None
    reference = np.tile(np.radians([10.0, 0.0, 10.0]), (30_000, 1))
    task = LoopTask(
        reference, np.zeros((30_000, 2)), np.zeros(3), profile.controller,
        profile.motor.V_o, profile.motor.v_max, profile.dt,
    )  # fmt: skip
    model = hover_model(profile)
    flown = fly(model, task)
    recording = recording_of_arrays(flown.t, flown.voltage, flown.angle, profile)
    best = np.inf
    for _ in range(3):
        start = time.perf_counter()
        predict(model, recording, 1.0)
        best = min(best, time.perf_counter() - start)
    return float(best)


def measure() -> list[Figure]:
    predict_s()  # compiles if the cache is empty
    return [
        at_least(
            "closed loop on the hover model at 500 Hz", simulation_speed(), 2000, "× real time",
            how="600 s, quantised encoders, one thread, best of 5",
        ),
        at_most(
            "controller, plain Python", tick_us(), 30, "µs", how="per period, best of 20 batches"
        ),
        at_most(
            "prediction 1 s ahead over 60 s at 500 Hz", predict_s(), 1.0, "s", how="best of 3"
        ),
    ]  # fmt: skip
