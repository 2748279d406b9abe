"""The base fit on a limit cycle finds the rig's inertias, also from a poor start."""

from __future__ import annotations

import numpy as np
import pytest

from heli3dof.experiment.plan import step_plan
from heli3dof.identification.bias_correction import correction
from heli3dof.identification.closed_loop_fit.base_fit import fit_base
from heli3dof.identification.closed_loop_fit.setup import Setup
from heli3dof.model.control.voltage_replay import with_known_controller
from tests.identification.known_flights import fly


@pytest.mark.accuracy
def test_if_the_search_from_the_matched_noise_diverges_the_fit_is_still_corrected(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The noise matched to this flight's pitch is 14 times too small. Without a correction the
    pitch inertia is 0.57 of the true one."""
    flight = fly(1, step_plan((10.0, None, None)), hide="")
    starts: list[bool] = []
    corrected_from = correction.corrected_from

    def noted(*args: object, **keywords: object) -> object:
        fit = corrected_from(*args, **keywords)  # type: ignore[arg-type]
        starts.append(fit is not None)
        return fit

    monkeypatch.setattr(correction, "corrected_from", noted)
    fit = fit_base(Setup((with_known_controller(flight.recording),), seed=0, flights_per_round=8))
    assert starts == [False, True]
    truth = np.array([flight.truth[f.name] for f in fit.free])
    assert fit.values[1:4] / truth[1:4] == pytest.approx(np.ones(3), abs=0.08)
