"""Encoder backlash is a candidate only if it is present, and its fitted width is correct."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from heli3dof.axes import AXES
from heli3dof.diagnosis.search.candidate_fits import CandidateFit, fit_start, trials
from heli3dof.diagnosis.search.catalogue import terms_without_score
from heli3dof.identification.bias_correction.corrected_maximum import maximise_corrected
from heli3dof.identification.closed_loop_fit.base_fit import LikelihoodWithInertiaPrior
from heli3dof.identification.greybox.estimate import Estimate, estimate
from heli3dof.identification.row_selection import usable_runs
from heli3dof.model.estimation.filter_data import data_of
from heli3dof.model.physics.parametrisation import Structure
from tests.flown import flown
from tests.profiles import profile


@cache
def base(hide: str, seed: int) -> Estimate:
    """The base model, without backlash, fitted to 30 s."""
    url = f"mock:?speed=max&seed={seed}&hide={hide}"
    r = flown("rich", 30.0, device=url, seed=seed, profile=profile(rate_hz=250.0))
    return estimate(
        LikelihoodWithInertiaPrior(data_of([r], usable_runs(r, 0)), Structure(r.profile, ()))
    )


def candidates(fitted: Estimate) -> list[str]:
    o = fitted.optimum
    return [
        t.term.name for t in trials(fitted.problem, o.theta, o.noise, terms_without_score((), AXES))
    ]


def test_present_terms_and_unmeasured_axes_are_not_tried() -> None:
    names = [t.name for t in terms_without_score(["encoder.backlash.roll"], ("roll", "pitch"))]
    assert names == ["encoder.backlash.pitch"]


def test_backlash_is_a_candidate_on_its_own_axis_only() -> None:
    assert candidates(base("encoder.backlash.pitch:0.4", 1150)) == ["encoder.backlash.pitch"]


@pytest.mark.parametrize("hide", ["", "friction.coulomb.pitch:0.012"])
def test_no_backlash_is_a_candidate_if_there_is_none(hide: str) -> None:
    assert candidates(base(hide, 1151)) == []


def test_the_grid_is_climbed_while_the_likelihood_rises() -> None:
    """A backlash of 1° behind an encoder step of 0.18° gains little at a small width."""
    gains = {0.05: 31, 0.09: 49, 0.16: 82, 0.28: 145, 0.5: 178, 0.9: 191, 1.6: 175, 2.8: -73}
    tried: list[float] = []

    def loglik(theta: np.ndarray, noise: np.ndarray) -> np.ndarray:
        width = float(theta[-1]) if len(theta) else 0.0
        tried.append(width)
        return np.array([gains.get(width, 0.0)])

    structure = SimpleNamespace(free=[SimpleNamespace(scaled=lambda w: w)])
    problem = cast(Any, SimpleNamespace(loglik=loglik, structure=structure))
    problem.with_term = lambda term: problem
    (trial,) = trials(problem, np.zeros(0), np.zeros(4), terms_without_score((), ("yaw",)))
    assert (trial.value, trial.gain) == (0.9, 191)
    assert tried == [0.0, 0.05, 0.09, 0.16, 0.28, 0.5, 0.9, 1.6]  # the base first


def test_the_score_of_a_term_without_a_score_test_is_compared_with_the_threshold() -> None:
    none = cast(Any, None)
    assert CandidateFit(none, none, none, 50.0, None, None).statistic == 50.0
    assert CandidateFit(none, none, none, 50.0, 9.0, 0).statistic == 9.0


def test_a_fit_started_from_the_trial_finds_the_backlash_width() -> None:
    fitted = base("encoder.backlash.pitch:0.4", 1150)
    o = fitted.optimum
    term = terms_without_score((), ("pitch",))[0]
    ext = fitted.problem.with_term(term)
    start, noise = fit_start(ext, o.theta, o.noise, term)
    assert noise[1] < 0.3 * o.noise[1]  # the base attributed the backlash to random torques
    fit = maximise_corrected(ext, start, noise, None)
    assert ext.values(fit.theta)[-1] == pytest.approx(0.4, abs=0.03)
    assert np.isfinite(fit.loglik)
