"""The filter for logs whose clock lies: against numbers that can be worked out by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.model.effects import terms
from heli3dof.model.estimation.ekf_jitter import filter_jittered, positions
from heli3dof.model.estimation.filter_data import RowRange, data_of
from heli3dof.model.greybox.model import nominal
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.recording.recording import Recording
from tests.identification.known_flights import fly

OFFSET = "encoder.offset.pitch.angle_deg"


@pytest.fixture(scope="module")
def recording() -> Recording:
    return fly(1021, "multisine", until_s=30.0).recording


def data(recording: Recording, start: int = 2500):  # type: ignore[no-untyped-def]
    return data_of([recording], [RowRange(0, start, len(recording))])


def test_a_number_that_varies_is_found_where_its_hook_keeps_it(recording: Recording) -> None:
    names = ("bias.torque.pitch", "encoder.offset.pitch")
    structure = Structure(recording.profile, terms(names))
    (place,) = positions(structure, (OFFSET,))
    *_, par, _ = structure.arguments(structure.values_of({OFFSET: 7.5}))
    assert par[place[0], place[1]] == 7.5


def test_a_sample_taken_late_moves_every_angle_by_its_rate(recording: Recording) -> None:
    """Shift every angle by q̇ δ: the likelihood knows δ's size, and misses it when given 0."""
    model = nominal(recording.profile)
    t = recording.t
    late = t + 0.003 * np.random.default_rng(1021).standard_normal(len(t))
    swing = np.radians([10.0, 15.0, 20.0]) * np.sin(2 * np.pi * 0.5 * late[:, None])
    d = data(replace(recording, angle=swing))
    noise = np.full(3, 2.0)
    at = {
        s: filter_jittered(model.structure, model.values, d, np.append(noise, s)).loglik.sum()
        for s in (0.0, 0.001, 0.003, 0.009)
    }
    assert max(at, key=lambda s: at[s]) == 0.003


def test_an_encoder_that_was_zeroed_elsewhere_is_found_again(recording: Recording) -> None:
    """4° is added to what pitch reads; yaw turns as the true angle says. The prior is wide."""
    structure = Structure(recording.profile, terms(("encoder.offset.pitch",)))
    angle = recording.angle + np.radians([0.0, 4.0, 0.0])
    noise = np.array([0.5, 0.5, 0.2, 0.0])

    def last(recording: Recording) -> float:
        d = data(recording)
        out = filter_jittered(structure, structure.values_of({}), d, noise, {OFFSET: 20.0})
        return float(out.states[-1, 6])

    assert last(replace(recording, angle=angle)) - last(recording) == pytest.approx(4.0, abs=0.4)
