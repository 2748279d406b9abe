"""The sections of a diagnosis in a report."""

from __future__ import annotations

import numpy as np

from heli3dof.diagnosis.validation.simulation_error import SimulationError
from heli3dof.report.pages.diagnosis_section import error_table


def test_an_unknown_noise_floor_is_stated_as_that() -> None:
    rmse = np.ones((1, 3))
    unknown = SimulationError((1.0,), rmse, np.full((1, 3), np.nan), "", ())
    assert error_table(unknown).notes[0].endswith(" Floor: unknown.")
    known = SimulationError((1.0,), rmse, rmse, "24 simulated flights", ())
    assert error_table(known).notes[0].endswith("noise alone causes, by 24 simulated flights.")
