"""The scan of frequencies on known scores."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from heli3dof.identification.bias_correction.scans import Frequencies, equivalent_z2
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
    z, values, time_shifts = peak(0.8)
    assert values == pytest.approx((SIZE, HZ, 0.8), rel=0.01, abs=0.02)
    assert z == pytest.approx(SIZE * np.sqrt(V), rel=0.01)
    assert time_shifts == ()


def test_the_second_recording_is_shifted_to_the_phase_of_the_first() -> None:
    """A quarter of a period ahead: sin(2π f t + φ + π/2) = sin(2π f (t + 1/(4 f)) + φ)."""
    z, values, time_shifts = peak(0.8, 0.8 + np.pi / 2)
    assert values == pytest.approx((SIZE, HZ, 0.8), rel=0.01, abs=0.02)
    assert z == pytest.approx(np.sqrt(equivalent_z2(2 * SIZE**2 * V, 2)), rel=0.01)
    assert time_shifts == pytest.approx((0.0, 1 / (4 * HZ)), abs=0.01)


@pytest.mark.parametrize("recordings", [2, 8])
def test_the_noise_of_several_recordings_has_the_largest_score_of_one(recordings: int) -> None:
    rng = np.random.default_rng(1920)
    scan = Frequencies(term("disturbance.periodic.yaw"))

    def largest(R: int) -> float:
        t, source = np.tile(T, R), np.repeat(np.arange(R), len(T))
        evaluation = cast(Any, SimpleNamespace(path=SimpleNamespace(t=t, source=source)))
        L = rng.standard_normal((len(t), 1)) * UNIT
        information = np.array([0.1, 8.0]), np.full(2, R * V)
        return float(scan.peak(evaluation, L, np.repeat(UNIT, len(t), axis=0), information)[0] ** 2)

    one, several = (np.median([largest(R) for _ in range(40)]) for R in (1, recordings))
    assert several == pytest.approx(one, rel=0.15)
