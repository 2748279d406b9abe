"""The noise and inertias of a rig on a limit cycle are estimated correctly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.identification.bias_correction.corrected_maximum import maximise_corrected
from heli3dof.identification.bias_correction.correction import model_at
from heli3dof.identification.bias_correction.simulated_flight import simulated_flight
from heli3dof.identification.closed_loop_fit.base_fit import LikelihoodWithInertiaPrior, fit_base
from heli3dof.identification.closed_loop_fit.limit_cycle import (
    cycling_shares,
    matched_noise,
    on_limit_cycle,
)
from heli3dof.identification.closed_loop_fit.setup import Setup
from heli3dof.identification.row_selection import usable_runs
from heli3dof.model.estimation.filter_data import data_of
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.recording.load import load
from heli3dof.recording.recording import Recording, recording_of_arrays
from heli3dof.rig.profile import load_profile
from tests.paths import REAL_DATA, needs_real_data
from tests.recording.make import open_profile

PLANT_2 = REAL_DATA / "plant-2"
RATE_HZ = 500


def counts_of(y: np.ndarray) -> Recording:
    """A recording whose roll angle has the counts y (N,); pitch and yaw rise evenly."""
    q = np.abs(open_profile().encoder.rad_per_count)
    t = np.arange(len(y)) / RATE_HZ
    others = np.round(np.outer(t, [40.0, 40.0]))
    return recording_of_arrays(
        t, np.full((len(t), 2), 7.0), np.column_stack([y, others]) * q, open_profile()
    )


@pytest.mark.parametrize(("period", "share"), [(50, 1.0), (5000, 0.0)])
def test_a_count_that_changes_to_and_fro_is_a_limit_cycle(period: int, share: float) -> None:
    """Ten changes per second between two counts are a limit cycle, one in 20 s is not."""
    data = data_of([counts_of((np.arange(10_000) // period) % 2)],
                   usable_runs(counts_of(np.zeros(10_000)), 0))  # fmt: skip
    assert cycling_shares(data)[0] == pytest.approx(share, abs=0.05)
    assert cycling_shares(data)[1:].max() == 0.0  # a steady motion is no limit cycle


def plant_2(name: str) -> tuple[Recording, LikelihoodWithInertiaPrior]:
    folder = PLANT_2 / name
    recording = load(folder / "rec.csv.gz", load_profile(folder / "profile.toml"))
    data = data_of([recording], usable_runs(recording, 0))
    return recording, LikelihoodWithInertiaPrior(data, Structure(recording.profile, ()))


@needs_real_data
def test_the_matched_noise_is_that_of_the_simulated_rig() -> None:
    """A roll noise of 0.004 rad/s²/√Hz is found from a start 25 times too large."""
    recording, problem = plant_2("st-c000")
    theta, noise = problem.prior_mean, np.array([0.004, 0.02, 0.0035, 0.0])
    rng = np.random.default_rng(2)
    flown = simulated_flight(model_at(problem, theta, noise), recording, rng)
    simulated = replace(problem, data=data_of([flown], problem.data.runs))
    axes = on_limit_cycle(simulated.data)
    assert axes.tolist() == [True, False, False]
    loud = noise * [25.0, 1.0, 1.0, 1.0]
    matched = matched_noise(simulated, theta, loud, axes, [flown], seed=0)
    assert matched[0] == pytest.approx(0.004, rel=0.5)
    assert matched[1:].tolist() == noise[1:].tolist()


@pytest.mark.accuracy
@needs_real_data
def test_a_step_on_a_limit_cycle_has_the_rigs_inertias() -> None:
    """Plant 2's inertias are the profile's; the likelihood alone gives 0.14 of roll's."""
    recording, _ = plant_2("st-c002")
    fit = fit_base(Setup((recording,), 0, 6))
    nominal = np.array([f.start for f in fit.structure.free[1:4]])
    assert fit.values[1:4] / nominal == pytest.approx(np.ones(3), abs=0.15)
    assert fit.optimum.noise[0] < 0.006


@needs_real_data
def test_the_noise_of_a_limit_cycle_stays_when_an_effect_is_fitted() -> None:
    """By likelihood alone the noise would increase again."""
    _, problem = plant_2("st-c000")
    known = replace(problem, known_noise=(True, False, False))
    noise = np.array([0.004, 0.02, 0.0035, 0.0])
    free, held = (maximise_corrected(p, p.prior_mean, noise, None) for p in (problem, known))
    assert held.noise[0] == 0.004
    assert free.noise[0] > 2 * held.noise[0]
