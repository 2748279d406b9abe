"""How often the encoders' counts change tells an estimate's flights from another rig's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.diagnosis import steps
from heli3dof.diagnosis.alike import against, edge_rates, rates_apart, widest
from heli3dof.diagnosis.corrected import Corrected
from heli3dof.diagnosis.steps import Bench, base_of, quieter
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import step_plan
from heli3dof.model.filtering import Stretch, data_of


@pytest.fixture(scope="module")
def fitted() -> tuple[Bench, Corrected]:
    flown = fly_plan(
        step_plan((10.0, None, None)), device="mock:?speed=max&seed=1022", seed=1022
    ).recording
    bench = Bench((flown,), seed=0, pilots=6)
    return bench, base_of(bench)


def test_the_rate_is_the_share_of_samples_at_which_a_count_changes(
    fitted: tuple[Bench, Corrected],
) -> None:
    (flown,), step = (
        fitted[0].recordings,
        np.abs(fitted[0].recordings[0].profile.encoder.rad_per_count),
    )
    counts = np.array([[0, 0, 5], [0, 1, 5], [1, 0, 5], [1, 1, 5], [1, 1, 6]])
    part = replace(flown.rows(slice(0, 5)), angle=counts * step)
    # Four intervals: roll changes in one, pitch in three, yaw in one.
    assert edge_rates(data_of([part], [Stretch(0, 0, 5)])) == pytest.approx([0.25, 0.75, 0.25])


def test_a_good_estimate_flies_like_the_recording_and_half_the_inertia_does_not(
    fitted: tuple[Bench, Corrected],
) -> None:
    bench, found = fitted
    assert abs(rates_apart(found, bench.recordings, seed=0)[1]) < widest()
    # A pitch axis of half the inertia chatters √2 times as fast.
    half = shifted(found, J_pitch=0.5)
    assert rates_apart(half, bench.recordings, seed=0)[1] < -widest()


def test_an_estimate_that_chatters_too_fast_is_solved_again_from_the_quiet_end(
    fitted: tuple[Bench, Corrected],
) -> None:
    bench, found = fitted
    other = quieter(bench, shifted(found, J_pitch=0.5, noise=4.0))
    assert np.log(other.values[2] / found.values[2]) == pytest.approx(0, abs=0.2)
    assert other.optimum.noise[1] / found.optimum.noise[1] == pytest.approx(1, rel=0.3)
    assert quieter(bench, found) is found


def test_an_estimate_without_another_solution_is_kept(
    fitted: tuple[Bench, Corrected], monkeypatch: pytest.MonkeyPatch
) -> None:
    bench, found = fitted
    loud = shifted(found, J_pitch=0.5)

    monkeypatch.setattr(steps, "correct", lambda *a, **k: replace(loud, scatter=None))
    assert quieter(bench, loud) is loud


def test_deviations_are_counted_in_what_the_flights_scatter() -> None:
    flown = np.array([[1.0], [3.0], [2.0]])  # mean 2, standard deviation 1
    assert against(np.array([5.0]), flown) == pytest.approx(3 / np.sqrt(4 / 3))


def shifted(found: Corrected, J_pitch: float, noise: float = 1.0) -> Corrected:
    """The estimate with another pitch inertia and noise."""
    theta, a = found.theta.copy(), found.optimum.noise.copy()
    theta[2] += np.log(J_pitch)
    a[1] *= noise
    return replace(found, optimum=replace(found.optimum, theta=theta, noise=a))
