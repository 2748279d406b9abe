"""The base fit: its starts, and its prior of implausible inertias."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from heli3dof.axes import AXES
from heli3dof.experiment.plan import step_plan
from heli3dof.identification.bias_correction import correction
from heli3dof.identification.bias_correction.correction import CorrectedFit
from heli3dof.identification.closed_loop_fit.base_fit import (
    TIGHT_PRIOR,
    LikelihoodWithInertiaPrior,
    fit_base,
    implausible_inertias,
    start_scales,
    with_plausible_inertias,
)
from heli3dof.identification.closed_loop_fit.setup import Setup
from heli3dof.identification.greybox.estimate import Estimate, estimate
from heli3dof.identification.row_selection import usable_runs
from heli3dof.model.control.voltage_replay import with_known_controller
from heli3dof.model.estimation.filter_data import data_of
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.recording.load import load
from tests.identification.known_flights import fly
from tests.paths import ROOT


@cache
def fitted() -> Estimate:
    recording = load(ROOT / "recordings" / "step-roll-10.mcap").between(6.0, 16.0)
    problem = LikelihoodWithInertiaPrior(
        data_of([recording], usable_runs(recording, 0)), Structure(recording.profile, ())
    )
    return estimate(problem)


def with_ratios(*ratios: float) -> CorrectedFit:
    """Return a fit whose trim torque and inertias have these ratios to nominal."""
    fit = fitted()
    profile = fit.structure.profile
    values = np.array([profile.trim_torque, *profile.inertias]) * ratios
    return CorrectedFit(
        fit.problem, replace(fit.optimum, theta=fit.problem.structure.scaled(values))
    )


@pytest.mark.parametrize(
    ("trim", "scales"), [(1.1, [1.0]), (0.7, [1.0, 0.7]), (1.4, [1.0, 1.4]), (0.3, [1.0])]
)
def test_a_search_also_starts_at_the_thrust_gain_of_a_trim_far_off(
    trim: float, scales: list[float]
) -> None:
    assert start_scales(with_ratios(trim, 1, 1, 1)) == pytest.approx(scales)


@pytest.mark.parametrize(
    ("ratios", "axes"),
    [((4, 4, 4), ()), ((0.25, 0.27, 0.24), ()), ((1, 4, 1), ("pitch",)), ((4, 4, 1), AXES[:2])],
)
def test_inertias_that_differ_by_one_factor_are_plausible(
    ratios: tuple[float, ...], axes: tuple[str, ...]
) -> None:
    """The thrust gain or the time is wrong, not three inertias."""
    assert implausible_inertias(with_ratios(1, *ratios)) == axes


def test_an_implausible_inertia_gets_a_narrow_prior_at_the_thrust_gain_of_the_others() -> None:
    """Trim torque, pitch and yaw have 0.7 of nominal, so 0.7 is expected of roll, too."""
    priors = []

    def fit(problem: object) -> CorrectedFit:
        assert isinstance(problem, LikelihoodWithInertiaPrior)
        priors.append(problem)
        return with_ratios(0.7, 0.2, 0.7, 0.7)

    with_plausible_inertias(fitted().problem, fit)
    wide, narrow = priors
    assert narrow.implausible == ("roll",)
    np.testing.assert_allclose(np.exp(narrow.prior_mean - wide.prior_mean)[1:4], 0.7, rtol=1e-6)
    ratio = np.sqrt(wide.prior_precision / narrow.prior_precision)[1:4]
    np.testing.assert_allclose(ratio, TIGHT_PRIOR, rtol=1e-6)
    held = replace(narrow, at_nominal=(1,))  # which keeps the profile's value
    assert held.prior_mean[1] == wide.prior_mean[1]


def test_plausible_inertias_need_one_fit() -> None:
    fits = []

    def fit(problem: object) -> CorrectedFit:
        fits.append(problem)
        return with_ratios(1.0, 0.8, 1.2, 1.0)

    with_plausible_inertias(fitted().problem, fit)
    assert len(fits) == 1


@pytest.mark.accuracy
def test_if_the_search_from_the_matched_noise_diverges_the_fit_is_still_corrected(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The noise matched to this flight's pitch is 14 times too small. Without a correction the
    pitch inertia is 0.57 of the true one."""
    flight = fly(1, step_plan((10.0, None, None)), hide="", rate_hz=500.0)
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
