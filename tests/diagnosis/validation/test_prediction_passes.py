"""Prediction variances stay finite when a rate decays faster than one integration step."""

from __future__ import annotations

import numpy as np
import pytest

from heli3dof.diagnosis.validation.prediction_passes import grow_stably


def grown(c: float, d: float) -> np.ndarray:
    """P (6, 6) after d seconds of v̇ = −c v + noise of intensity 1 on roll, from rest."""
    A, P = np.zeros((3, 6)), np.zeros((6, 6))
    A[0, 3] = -c
    grow_stably(P, A, d, np.array([1.0, 0.0, 0.0]), np.empty((3, 6)))
    return P


def test_fast_friction_gives_its_stationary_variance() -> None:
    """1/(2c) in the rate; an explicit step with c d = 5 would grow without bound."""
    assert grown(250.0, 0.02)[3, 3] == pytest.approx(1 / 500, rel=0.35)
    assert grown(250.0, 2.0)[3, 3] == pytest.approx(1 / 500, rel=0.35)


def test_without_friction_the_variance_is_that_of_a_double_integrator() -> None:
    assert grown(0.0, 0.3)[0, 0] == pytest.approx(0.3**3 / 3)
