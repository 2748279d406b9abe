from __future__ import annotations

import numpy as np
import pytest

from heli3dof.identification.feedback import feedback_test
from tests.identification.systems import integrating_system, record


def test_feedback_is_detected() -> None:
    verdict = feedback_test([record(integrating_system(2e-2), 2000, 1)])
    assert verdict.present
    assert verdict.p_value < 1e-6
    assert "Feedback" in verdict.sentence


def test_the_false_alarm_rate_is_nominal() -> None:
    """100 records of a system without feedback, seeds 0–99: p below 5 % in about 5."""
    system = integrating_system()
    p = [feedback_test([record(system, 800, s, gain=None)]).p_value for s in range(100)]
    assert sum(v < 0.05 for v in p) <= 13
    assert sum(v < 1e-3 for v in p) <= 1
    assert np.median(p) == pytest.approx(0.5, abs=0.2)


def test_coloured_excitation_is_not_feedback() -> None:
    system = integrating_system()
    rng = np.random.default_rng(0)
    u, _ = record(system, 2000, 3, gain=None)
    for k in range(1, len(u)):
        u[k] += 0.95 * u[k - 1]
    y = np.zeros((2000, 3))
    x = np.zeros(5)
    e = 1e-3 * rng.standard_normal((2000, 3))
    for k in range(2000):
        y[k] = system.C @ x + e[k]
        x = system.A @ x + system.B @ u[k] + system.K @ e[k]
    assert not feedback_test([(u, y)]).present


def test_a_deterministic_voltage_has_no_feedback() -> None:
    u, y = record(integrating_system(), 1000, 1, gain=None)
    u = np.sin(np.arange(1000)[:, None] * [0.1, 0.13])
    verdict = feedback_test([(u, y)])
    assert not verdict.present
    assert verdict.p_value == 1.0


def test_several_short_segments_are_pooled() -> None:
    data = [record(integrating_system(2e-2), 300, s) for s in range(6)]
    assert feedback_test(data).present


def test_negligible_feedback_is_reported_as_none() -> None:
    # σ = 1e-3 against an excitation of 0.05 V: a few 1e-4 of the voltages' innovation
    verdict = feedback_test([record(integrating_system(1e-3), 2000, 1)])
    assert not verdict.present
    assert "No feedback detected" in verdict.sentence
