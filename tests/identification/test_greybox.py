"""The grey-box estimator on flights of the mock rig, an independent plant."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.errors import RecordingError
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.linear_uncertainty import linear_quantities
from heli3dof.identification.greybox.maximum_likelihood import maximise
from heli3dof.identification.greybox.method import (
    DEFAULT_TERMS,
    fit_greybox,
    model_of,
    parameters,
    warnings,
)
from heli3dof.identification.identify import identify
from heli3dof.model.effects import term
from heli3dof.recording.recording import Recording
from tests.bench.bench_greybox import one_start
from tests.flown import flown
from tests.identification.greybox_score_test import score_test
from tests.identification.known_flights import HIDDEN, Flight, fly

ABSENT = (
    "motor.delay", "motor.dead_zone", "motor.thrust_curve", "motor.thrust_mismatch",
    "friction.coulomb.roll", "friction.coulomb.pitch", "friction.coulomb.yaw",
    "stiffness.cable.yaw", "drag.quadratic.roll", "drag.quadratic.pitch", "drag.quadratic.yaw",
    "aero.inflow", "motor.supply_sag", "encoder.offset.pitch",
)  # fmt: skip


@pytest.fixture(scope="module")
def flight() -> Flight:
    return fly(1011, "multisine")


@pytest.fixture(scope="module")
def found(flight: Flight) -> Estimate:
    return fit_greybox(flight.recording)


@pytest.fixture(scope="module")
def steps() -> Flight:
    return fly(1012, "steps")


@pytest.fixture(scope="module")
def from_steps(steps: Flight) -> Estimate:
    return fit_greybox(steps.recording)


def z_scores(found: Estimate, flight: Flight) -> np.ndarray:
    truth = np.array([flight.truth[f.name] for f in found.free])
    return (found.values - truth) / found.std


def test_every_parameter_is_within_its_interval(found: Estimate, flight: Flight) -> None:
    z = z_scores(found, flight)
    assert found.optimum.converged
    assert np.abs(z).max() < 3.5
    assert np.sqrt((z**2).mean()) < 1.6


def test_the_rotor_lag_from_steps_is_accurate_to_a_few_percent(from_steps: Estimate) -> None:
    j = from_steps.structure.names.index("motor.lag.time_constant_s")
    assert from_steps.values[j] == pytest.approx(0.1, rel=0.06)
    assert from_steps.std[j] / 0.1 < 0.03


def test_standard_deviations_are_close_to_the_cramer_rao_bound(found: Estimate) -> None:
    assert (found.std > 0.8 * found.bound).all()
    assert (found.std < 1.5 * found.bound).all()


def test_the_process_noise_is_right(found: Estimate, flight: Flight) -> None:
    ratio = found.optimum.noise[:3] / flight.noise[:3]
    assert ((ratio > 0.7) & (ratio < 1.6)).all()
    assert found.optimum.noise[3] == 0.0  # the mock samples on time


@pytest.mark.parametrize("name", ABSENT)
def test_absent_effects_score_low_on_steps(from_steps: Estimate, name: str) -> None:
    """With the encoder as white noise, `motor.delay` scores 180 here."""
    assert score_test(from_steps, term(name)).score < 20


def test_a_hidden_effect_has_the_highest_score() -> None:
    flight = fly(1013, "multisine", hide=HIDDEN + ",friction.coulomb.yaw:0.03")
    result = fit_greybox(flight.recording)
    scores = {n: score_test(result, term(n)).score for n in ABSENT}
    assert max(scores, key=lambda n: scores[n]) == "friction.coulomb.yaw"
    assert scores["friction.coulomb.yaw"] > 100


@pytest.mark.accuracy
@pytest.mark.parametrize(
    ("hide", "parameter", "value"),
    [
        ("motor.delay:0.02", "motor.delay.delay_s", 0.02),
        ("motor.thrust_curve:0.4", "motor.thrust_curve.quadratic_share", 0.4),
    ],
)
def test_a_hidden_effect_is_fitted_together_with_the_others(
    hide: str, parameter: str, value: float
) -> None:
    flight = fly(1014, "multisine", hide=f"{HIDDEN},{hide}")
    name = hide.partition(":")[0]
    result = fit_greybox(flight.recording, (*DEFAULT_TERMS, name))
    j = result.structure.names.index(parameter)
    assert abs(result.values[j] - value) < 3.5 * result.std[j]
    assert result.std[j] < 0.1 * value


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_starts_off_by_a_factor_of_two_reach_the_same_optimum(
    found: Estimate, factor: float
) -> None:
    theta = found.problem.prior_mean.copy()
    for j, f in enumerate(found.free):
        theta[j] = theta[j] + np.log(factor) if f.log else theta[j] * factor
    again = maximise(found.problem, theta)
    sd = found.std / found.slopes
    assert (np.abs(again.theta - found.optimum.theta) / sd).max() < 0.1


@pytest.mark.accuracy
def test_a_distant_start_reaches_the_same_optimum() -> None:
    assert one_start(5) < 0.1


def test_two_recordings_give_smaller_deviations_than_one(found: Estimate, flight: Flight) -> None:
    # The same rig twice: half of the flight each against the whole of it.
    r = flight.recording
    first = fit_greybox(r.between(0, 38))
    both = fit_greybox([r.between(0, 38), r.between(38, 80)])
    assert (both.std < first.std).mean() > 0.9
    np.testing.assert_allclose(both.values, found.values, atol=1.0 * found.std.max())


def one_angle(recording: Recording, axis: int) -> Recording:
    angle = np.full_like(recording.angle, np.nan)
    angle[:, axis] = recording.angle[:, axis]
    return replace(recording, angle=angle)


def test_a_pitch_only_recording_identifies_pitch_parameters_only(flight: Flight) -> None:
    part = one_angle(flight.recording.between(5, 60), 1)
    result = fit_greybox(part)
    names = result.structure.names
    j = names.index("J_pitch")
    assert result.values[j] == pytest.approx(flight.truth["J_pitch"], rel=0.05)
    unidentifiable = {n for n, v in zip(names, result.verdicts, strict=True) if v}
    assert {"J_roll", "J_yaw", "T_g", "friction.viscous.yaw.damping_Nms_per_rad"} <= unidentifiable
    assert "J_pitch" not in unidentifiable
    assert any("heli3dof run" in w for w in warnings(result))


def test_the_fit_does_not_depend_on_a_known_controller(flight: Flight, found: Estimate) -> None:
    r = flight.recording
    blind = replace(r, profile=r.profile.model_copy(update={"controller": None}))
    np.testing.assert_array_equal(fit_greybox(blind).values, found.values)


def test_a_flight_that_stays_on_the_table_is_rejected(flight: Flight) -> None:
    r = flight.recording
    on_table = replace(r, angle=np.tile(r.angle[0], (len(r), 1)))
    for outcome, cause in (("completed", "never left its table"), ("tripped", "ended for safety")):
        with pytest.raises(RecordingError, match="usable rows") as caught:
            fit_greybox(replace(on_table, meta={**r.meta, "outcome": outcome}))
        assert cause in caught.value.cause


def test_the_model_replays_held_out_data(flight: Flight, found: Estimate) -> None:
    model = model_of(found, [flight.recording], "mine")
    assert model.extra["recordings"][0]["sha256"] == flight.recording.digest
    result = identify(flight.recording, method="greybox")
    fit = result.metrics.replay.fit_percent
    assert (fit > [97, 88, 95]).all()
    shown = result.to_dict()
    lag = shown["parameters"]["motor.lag.time_constant_s"]
    assert lag["std"] > 0
    assert lag["cramer_rao_bound"] > 0
    table = result.to_dataframe()
    assert table.loc["motor.lag.time_constant_s", "std"] == lag["std"]
    assert (
        f"motor.lag.time_constant_s = {lag['value']:.4g} ± {lag['std']:.2g} s" in result.summary()
    )
    assert result.residuals[0].passed


def test_a_delay_of_zero_is_no_compensation_of_another_effect() -> None:
    fit = fit_greybox(flown("rich", 15.0, device="mock:?speed=max", seed=5), ("motor.delay",))
    assert fit.values[-1] < 0.001
    at_zero = replace(
        fit,
        optimum=replace(
            fit.optimum,
            theta=np.append(fit.theta[:-1], 0.0),
            at_bound=np.append(fit.optimum.at_bound[:-1], True),
        ),
    )
    assert not [w for w in warnings(at_zero) if "motor.delay" in w]


def test_a_lag_at_its_least_value_is_no_compensation_of_another_effect() -> None:
    """The emulated rig has no lag. An inertia at its bound does compensate something."""
    fit = fit_greybox(flown("rich", 15.0, device="mock:?speed=max", seed=5), ("motor.lag",))
    assert fit.optimum.at_bound[-1]
    assert not [w for w in warnings(fit) if "at its bound" in w]
    stuck = replace(fit, optimum=replace(fit.optimum, at_bound=np.ones(5, dtype=bool)))
    assert [w.partition(" ")[0] for w in warnings(stuck)][-4:] == [f.name for f in fit.free[:4]]
    # So it is not significant, and the linearised model has no pole at −1000 rad/s.
    lag = parameters(fit)["motor.lag.time_constant_s"]
    assert lag.std >= lag.value
    poles, _, _ = linear_quantities(fit, model_of(fit, [], "stuck"), 0.002)
    assert len(poles) == 6
    assert max(abs(p.value) for p in poles) < 1.0


def test_the_fit_finds_the_instant_of_a_change_of_mass() -> None:
    """From the default start, at time 0, the likelihood has a local maximum without the mass."""
    device = "mock:?speed=max&seed=3&hide=mass.change:0.05@12"
    recording = flown("levels", 22.0, device=device, seed=3)
    found = fit_greybox(recording, ["mass.change"])
    mass, instant = found.values[-2:]
    assert instant == pytest.approx(12.0, abs=0.2)
    assert mass == pytest.approx(0.05, rel=0.1)
