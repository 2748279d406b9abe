"""The scan of frequencies on known scores."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from heli3dof.diagnosis.screening.scans import Frequencies
from heli3dof.model.effects import term

T, SIZE = np.arange(0.0, 40.0, 0.02), 3.0
HZ = 123 / (8192 * 0.02)
"""A frequency of the Fourier transform of the 2000 samples, extended to 8192"""
V = 1000.0
"""Information of a unit torque: Σ sin² over the 2000 samples of one recording"""
UNIT = np.array([[0.0, 0.0, 1.0]])


def peak(*phases: float) -> Any:
    """Return the peak for a torque with these phases, one per recording of 40 s."""
    R = len(phases)
    score = np.concatenate([SIZE * np.sin(2 * np.pi * HZ * T + phi) for phi in phases])
    t, source = np.tile(T, R), np.repeat(np.arange(R), len(T))
    evaluation = cast(Any, SimpleNamespace(path=SimpleNamespace(t=t, source=source)))
    L = score[:, None] * UNIT
    information = np.array([0.1, 8.0]), np.full(2, R * V)
    unit = np.repeat(UNIT, len(t), axis=0)
    return Frequencies(term("disturbance.periodic.yaw")).peak(evaluation, L, unit, information)


def test_one_recording_gives_size_frequency_and_phase_and_no_clocks() -> None:
    found = peak(0.8)
    assert found.values == pytest.approx((SIZE, HZ, 0.8), rel=0.01, abs=0.02)
    assert found.z == pytest.approx(SIZE * np.sqrt(V), rel=0.01)
    assert found.clocks == ()


def test_opposite_phases_in_two_recordings_add_up_and_their_clocks_differ_by_half_a_period() -> (
    None
):
    found = peak(0.8, 0.8 + np.pi)
    assert found.values == pytest.approx((SIZE, HZ, 0.8), rel=0.01, abs=0.02)
    assert found.z == pytest.approx(SIZE * np.sqrt(2 * V), rel=0.01)
    assert found.clocks == pytest.approx((0.0, 1 / (2 * HZ)), abs=0.01)
