"""The weak form: its integrals, and initial values close to the truth on a mock flight."""

from __future__ import annotations

import numpy as np
import pytest

from heli3dof.identification.greybox.freeflight import problem_of
from heli3dof.identification.greybox.method import DEFAULT_TERMS
from heli3dof.identification.greybox.weak_form import span, weak_start
from tests.identification.known_flights import fly

DT = 0.002


def test_a_parabola_has_its_own_acceleration() -> None:
    """q = 3 t²/2 + 5t − 2: the weak form compares 3 rad/s² with the model's."""
    t = np.arange(0, 2, DT)
    q = np.repeat((1.5 * t**2 + 5 * t - 2)[:, None], 3, axis=1)
    result = span(np.ones(len(t), dtype=bool), DT, 0.4).integrals(q, np.full_like(q, 2.0))
    np.testing.assert_allclose(result, 1.0, rtol=1e-3)


def test_spans_lie_on_free_rows_only() -> None:
    free = np.ones(1000, dtype=bool)
    free[500] = False
    first = span(free, DT, 0.4).rows
    assert not np.any((first <= 500) & (first + 200 > 500))
    assert np.any(first > 500)


def test_the_start_is_within_a_tenth_of_the_truth() -> None:
    flight = fly(1024, spread=0.0, until_s=40.0)
    problem = problem_of([flight.recording], DEFAULT_TERMS)
    at = dict(zip(problem.structure.names, problem.values(weak_start(problem)), strict=True))
    for name in ("T_g", "J_roll", "J_pitch", "J_yaw", "stiffness.pendulum.roll.torque_Nm"):
        assert at[name] == pytest.approx(flight.truth[name], rel=0.10), name
    lag = "motor.lag.time_constant_s"
    assert at[lag] == pytest.approx(flight.truth[lag], rel=0.15)
