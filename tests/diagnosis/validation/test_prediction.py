"""Phases and instants of held-out recordings. Seeds from 1900."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.diagnosis.validation.prediction import rows_of_recordings, with_own_values
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.identification.row_selection import usable_runs
from heli3dof.model.effects import terms
from heli3dof.model.estimation.filter_data import data_of
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.recording.recording import Recording
from tests.flown import flown

NOISE = np.array([0.02, 0.1, 0.02, 0.0])
"""Process noise of roll, pitch and yaw in rad/s²/√Hz; jitter in s"""
TORQUE_NM, FREQUENCY_HZ = 0.1, 0.4
MASS_KG, PUT_DOWN_S = 0.05, 11.0


def own_value(effect: str, values: dict[str, float], recordings: list[Recording]) -> list[float]:
    """Return the phase or instant of each recording, the last parameter of the ``effect``."""
    structure = Structure(recordings[0].profile, terms([effect]))
    runs = [run for i, r in enumerate(recordings) for run in usable_runs(r, i)]
    problem = Likelihood(data_of(recordings, runs), structure)
    named = {f"{effect}.{name}": value for name, value in values.items()}
    theta = problem.structure.scaled(structure.values_of(named))
    return [
        float(problem.values(with_own_values(problem, theta, NOISE, rows))[-1])
        for rows in rows_of_recordings(problem.data)
    ]


@pytest.mark.parametrize(("start_s", "later_s"), [(None, 12.5 - 2.0), (0.0, 0.0)])
def test_a_recording_has_the_phase_at_its_start_and_a_part_that_of_the_whole(
    start_s: float | None, later_s: float
) -> None:
    hide = f"disturbance.periodic.yaw:{TORQUE_NM}@{FREQUENCY_HZ}"
    flight = flown("rich", 26.0, device=f"mock:?speed=max&start=level&hide={hide}", seed=1900)
    parts = [
        replace(flight.between(*times), start_s=start_s) for times in ((2.0, 12.0), (12.5, 26.0))
    ]
    values = {"torque_Nm": TORQUE_NM, "frequency_Hz": FREQUENCY_HZ}
    first, second = own_value("disturbance.periodic.yaw", values, parts)
    later = 2 * np.pi * FREQUENCY_HZ * later_s
    assert np.angle(np.exp(1j * (second - first - later))) == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize("start_s", [4.0, 12.0], ids=["within", "before"])
def test_a_mass_in_a_part_is_put_down_at_the_time_of_the_whole(start_s: float) -> None:
    hide = f"mass.change:{MASS_KG}@{PUT_DOWN_S}"
    flight = flown("rich", 20.0, device=f"mock:?speed=max&start=level&hide={hide}", seed=1901)
    part = flight.between(start_s, 20.0)
    (found,) = own_value("mass.change", {"mass_kg": MASS_KG, "time_s": 0.0}, [part])
    before = start_s > PUT_DOWN_S
    assert found <= start_s if before else found == pytest.approx(PUT_DOWN_S, abs=0.3)
