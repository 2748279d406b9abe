"""A linear controller in simulated flights, checked with numbers that are easy to compute."""

from __future__ import annotations

import numpy as np

from heli3dof.model.control.controller import N_OUT
from heli3dof.model.control.simulated_controller import controller_arrays, simulated_law
from heli3dof.recording.linear_controller import LinearController


def test_a_filter_of_first_order_adds_half_of_its_last_voltage() -> None:
    """v[k] = v[k−1]/2 − 2 roll[k] + roll[k−1] + w[k] on the front motor, limited to ±5 V."""
    A, B = np.zeros((1, 2, 2)), np.zeros((2, 2, 3))
    A[0, 0, 0], B[0, 0, 0], B[1, 0, 0] = 0.5, -2.0, 1.0
    p, s = controller_arrays(LinearController(A, B), 7.0, 5.0, 0.002, np.zeros(3))
    out, front = np.empty(N_OUT), []
    for roll in (0.0, 1.0, 0.0):
        simulated_law(p, s, np.array([roll, 9.0, 9.0]), np.zeros(3), np.array([4.0, 7.0]), out)
        front.append(out.tolist())
    assert front == [[4.0, 7.0, 4.0, 5.0], [4.0, 7.0, 4.0, 5.0], [7.0, 7.0, 5.0, 5.0]]


def test_with_its_input_a_law_of_any_order_repeats_the_voltages_of_the_log() -> None:
    rng = np.random.default_rng(4)
    v, y = rng.normal(size=(30, 2)), rng.normal(size=(30, 3))
    for n in (1, 2, 4):
        A = rng.uniform(-0.4, 0.4, (n, 2, 2)) / n  # a stable law: rounding errors do not grow
        law = LinearController(A, rng.normal(size=(n + 1, 2, 3)))
        p, s = controller_arrays(law, 0.0, 100.0, 0.002, y[0])
        out = np.empty(N_OUT)
        for k, w in enumerate(law.input_of(v, y)):
            simulated_law(p, s, y[k], np.zeros(3), w, out)
            np.testing.assert_allclose(out[2:], v[k], atol=1e-9)
