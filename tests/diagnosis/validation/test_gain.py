"""Prediction error of a model, and the gain of an extension on held-out data."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from heli3dof.diagnosis.validation import simulation_error as validation
from heli3dof.diagnosis.validation.cross_validation import (
    BACKLASH_SETTLE_S,
    PURGE_S,
    SETTLE_S,
    _estimate_without,
    _most_likely_noise,
    _restricted,
    on_blocks,
    on_holdout,
    row_by_row,
    settling_s,
    training,
)
from heli3dof.diagnosis.validation.gain import HeldOut, Predictions, gain, gain_interval_positive
from heli3dof.diagnosis.validation.prediction import HORIZONS_S, mean_square, model_errors
from heli3dof.diagnosis.validation.simulation_error import (
    covariance_floor_deg,
    noise_floor_deg,
    simulation_error,
)
from heli3dof.experiment.plan import step_plan
from heli3dof.identification.bias_correction.corrected_maximum import maximise_corrected
from heli3dof.identification.bias_correction.correction import CorrectedFit
from heli3dof.identification.closed_loop_fit.base_fit import LikelihoodWithInertiaPrior
from heli3dof.identification.greybox.estimate import Estimate, estimate
from heli3dof.identification.greybox.method import fit_greybox, model_of
from heli3dof.identification.row_selection import usable_runs
from heli3dof.model.effects import terms
from heli3dof.model.estimation.filter_data import Data, data_of
from heli3dof.model.greybox.model import nominal
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.recording.recording import Recording
from heli3dof.report.figures.replayed_flight import replayed
from heli3dof.report.figures.worst_stretch import worst_stretch
from tests.flown import flown
from tests.profiles import profile

HIDDEN = "friction.viscous.yaw"


def flight(seed: int, plan: str = "rich", until_s: float = 90.0) -> Recording:
    device = f"mock:?speed=max&hide={HIDDEN}:0.05"
    return flown(plan, until_s, device=device, seed=seed, profile=profile(rate_hz=250.0))


@pytest.fixture(scope="module")
def recording() -> Recording:
    return flight(1211)


@pytest.fixture(scope="module")
def base(recording: Recording) -> Estimate:
    return fit_greybox(recording, ())


@pytest.fixture(scope="module")
def right(recording: Recording) -> Estimate:
    return fit_greybox(recording, (HIDDEN,))


def cells(loglik: list[float], errors_rad: list[float]) -> HeldOut:
    m = len(loglik)
    squares = np.repeat(np.array(errors_rad)[:, None] ** 2, 3, axis=1)
    counts = np.ones((m, 3))
    none = Predictions(np.zeros(0), np.zeros(0, dtype=int), np.zeros((0, 3)), np.zeros((0, 3)))
    start_s, source = 2.0 * np.arange(m), np.zeros(m, dtype=int)
    return HeldOut(np.array(loglik), squares, counts, start_s, source, "holdout", none)


def test_the_gain_is_the_difference_and_lies_in_its_interval() -> None:
    before = cells([-10.0, -20.0, -30.0, -20.0], [0.02, 0.04, 0.02, 0.02])
    after = cells([-8.0, -15.0, -27.0, -18.0], [0.02, 0.02, 0.02, 0.02])
    g = gain(before, after)
    assert g.log_likelihood.value == pytest.approx(12.0)
    # Cells of 2, 5, 3 and 2: s = √2, so 12 ± 3.18 · √4 · √2.
    assert g.log_likelihood.low == pytest.approx(12.0 - 3.18 * 2 * 1.414, abs=0.4)
    # √((3·0.02² + 0.04²)/4) rad is 1.516°, 0.02 rad is 1.146°.
    assert g.rmse_deg["roll"] is not None
    assert g.rmse_deg["roll"].value == pytest.approx(1.516 - 1.146, abs=1e-3)
    assert gain_interval_positive(g)


def test_two_cells_leave_the_gain_uncertain_and_one_determines_nothing() -> None:
    """Student's t with one degree of freedom: gains of 80 and 90 sum to 170 ± 12.7 · 10."""
    before, after = cells([-100.0, -100.0], [0.02] * 2), cells([-20.0, -10.0], [0.02] * 2)
    assert gain(before, after).log_likelihood.low == pytest.approx(170 - 127, abs=6)
    alone = gain(cells([-100.0], [0.02]), cells([-20.0], [0.01]))
    assert not gain_interval_positive(alone)
    assert not alone.removes_most_error


def test_a_gain_in_one_cell_with_losses_in_others_does_not_pay() -> None:
    before = cells([0.0] * 10, [0.02] * 10)
    after = cells([30.0] + [-2.0] * 9, [0.02] * 10)
    assert gain(before, after).log_likelihood.value > 0
    assert not gain_interval_positive(gain(before, after))


def test_training_rows_keep_the_purge_distance_from_the_block_left_out(base: Estimate) -> None:
    d = base.problem.data
    a, b = 2500, 4000
    kept = np.zeros(len(d.t), dtype=bool)
    for lead, start, stop in training(d, (a, b)).blocks:
        kept[start:stop] = True
        assert lead <= start
    purge = round(PURGE_S / 0.004)
    assert not kept[a - purge : b + purge].any()
    assert kept[a - purge - 1]
    assert kept[b + purge]


def test_a_limit_cycle_while_the_filter_settles_does_not_change_a_block_s_noise(
    right: Estimate,
) -> None:
    o = right.optimum
    rows = (12_000, 15_000)
    near = _restricted(right.problem.data, [rows], settle_s=SETTLE_S)
    start = int(near.blocks[0, 1])
    y = near.y.copy()
    y[start : start + 8 : 2, 0] = y[start, 0]
    y[start + 1 : start + 8 : 2, 0] = y[start, 0] - near.rad_per_count[0]
    quiet = replace(right.problem, data=near)
    limit_cycle = replace(right.problem, data=replace(near, y=y))
    plain = _most_likely_noise(quiet, o.theta, o.noise, rows[0])
    # If counted, the limit cycle would add a fifth to the noise here, ten times on a resting axis.
    assert _most_likely_noise(limit_cycle, o.theta, o.noise, rows[0])[0] == pytest.approx(
        plain[0], rel=0.05
    )


def test_a_block_s_noise_is_the_likeliest_value_tried() -> None:
    """ln Z = −20 u for u = ln a, and −1000 below u = −0.2: Newton from 0.5 steps to −0.5, over the
    edge, and back repeatedly; it evaluates 0.4 to either side."""
    data = SimpleNamespace(t=np.zeros(1), blocks=[(0, 0, 1)], axes=np.ones(3, dtype=bool))

    def run(theta: np.ndarray, a: np.ndarray, *, keep: int) -> Any:
        u = np.log(a[:3])
        return SimpleNamespace(X=np.r_[np.zeros(6), np.where(u > -0.2, -20 * u, -1000.0)][None])

    problem = cast(Any, SimpleNamespace(data=data, run=run))
    a = _most_likely_noise(problem, np.zeros(4), np.append(np.exp([0.5] * 3), 0.0), 0)
    assert np.log(a[:3]) == pytest.approx(-0.5 + 0.4)
    assert a[3] == 0.0


def test_the_right_extension_pays_and_an_unnecessary_one_does_not(
    recording: Recording, base: Estimate, right: Estimate
) -> None:
    plain, better = on_blocks(base), on_blocks(right)
    g = gain(plain, better)
    assert g.on == "blocks left out"
    assert gain_interval_positive(g)
    assert g.rmse_deg["yaw"] is not None
    assert g.rmse_deg["yaw"].value > 0
    needless = on_blocks(fit_greybox(recording, (HIDDEN, "drag.quadratic.roll")))
    assert not gain_interval_positive(gain(better, needless))


def test_without_the_only_step_an_inertia_stays_near_its_prior(
    base: Estimate,
) -> None:
    """The rest is a hold, whose score of J_roll has little information; b is its scatter."""
    step = flown(step_plan((10.0, None, None)), device="mock:?speed=max", seed=1213)
    runs = usable_runs(step, 0)
    problem = LikelihoodWithInertiaPrior(data_of([step], runs), base.problem.structure)
    fit = estimate(problem)
    o = fit.optimum
    at = problem.run(o.theta, o.noise)
    tangents = problem.tangents(o.theta, at)
    d = problem.data
    rows = (int(np.searchsorted(d.t, 9.0)), int(np.searchsorted(d.t, 16.0)))
    b = 300.0
    bias = np.array([0.0, -b, 0.0, 0.0])  # as if the hold had this biased score of J_roll

    def moved(scatter: np.ndarray | None) -> float:
        """ln J_roll without the step, less with it."""
        result = CorrectedFit(problem, o, scatter, bias, np.zeros(3), 12)
        return float((_estimate_without(result, at, tangents, rows) - o.theta)[1])

    run_off = moved(None)
    stays = moved(np.diag([1.0, b**2, 1.0, 1.0]))
    assert run_off > np.log(2)  # twice the inertia
    # Λ C/H ≫ H: within about b/(Λ C/H) of the prior's mean, a fraction of the tolerance.
    tolerance = step.profile.tolerance
    assert abs(o.theta[1] + stays - problem.prior_mean[1]) < tolerance


@pytest.fixture(scope="module")
def changed() -> Estimate:
    """Fit of a flight with backlash in roll's encoder and 20 g added at 30 s."""
    hide = "encoder.backlash.roll:0.5,mass.change:0.02@30"
    recording = flown("rich", 50.0, device=f"mock:?speed=max&hide={hide}", seed=1214)
    problem = LikelihoodWithInertiaPrior(
        data_of([recording], usable_runs(recording, 0)),
        Structure(recording.profile, terms(["encoder.backlash.roll", "mass.change"])),
    )
    values = [f.start for f in problem.structure.free[:4]] + [0.5, 0.02, 30.0]
    noise = np.array([0.004, 0.013, 0.002, 0.0])
    fit = maximise_corrected(problem, problem.structure.scaled(np.array(values)), noise, None)
    return CorrectedFit(problem, fit)


def test_an_instant_stays_fixed_when_its_own_block_is_left_out(changed: Estimate) -> None:
    problem, o = changed.problem, changed.optimum
    at = problem.run(o.theta, o.noise)
    t = problem.data.t
    rows = (int(np.searchsorted(t, 25.0)), int(np.searchsorted(t, 37.0)))
    theta = _estimate_without(changed, at, problem.tangents(o.theta, at), rows)
    values = dict(zip(problem.structure.names, problem.values(theta), strict=True))
    # If free, it would move to 0.5 s: a rig that is heavier from the start.
    assert values["mass.change.time_s"] == pytest.approx(30.0, abs=1e-9)
    assert values["mass.change.mass_kg"] == pytest.approx(0.02, rel=0.1)
    assert values["encoder.backlash.roll.angle_deg"] == pytest.approx(0.5, abs=0.03)


def test_with_backlash_a_filter_settles_as_if_run_from_the_start(
    changed: Estimate, right: Estimate
) -> None:
    assert (settling_s(right.problem), settling_s(changed.problem)) == (SETTLE_S, BACKLASH_SETTLE_S)
    problem, o = changed.problem, changed.optimum
    d = problem.data
    first, stop = (int(d.blocks[0, k]) for k in (1, 2))
    before = round(BACKLASH_SETTLE_S / 0.002)

    def roll(data: Data) -> np.ndarray:
        """(N,) ln Z of roll's rows"""
        X = replace(problem, data=data).run(o.theta, o.noise, keep=3).X
        return np.asarray(row_by_row(data, X)[:, 0])

    whole = roll(d)
    for a in range(first + before, stop - 1000, 1000):  # a block of 2 s every 2 s
        near = _restricted(d, [(a, a + 1000)], settle_s=BACKLASH_SETTLE_S)
        assert int(near.blocks[0, 1]) == a - before
        apart = roll(near)[a : a + 1000].sum() - whole[a : a + 1000].sum()
        assert abs(apart) < 1.0


def test_the_right_extension_pays_on_a_second_flight(base: Estimate, right: Estimate) -> None:
    second = [flight(1212, until_s=40.0)]
    before, after = on_holdout(base, second), on_holdout(right, second)
    g = gain(before, after)
    assert g.on == "holdout"
    assert gain_interval_positive(g)
    worst = worst_stretch(before, after)
    assert worst is not None
    assert worst.axis == "yaw"
    assert worst.after_deg < worst.before_deg


def test_prediction_errors_are_those_of_the_model_s_own_predictions(
    recording: Recording, base: Estimate
) -> None:
    model = model_of(base, [recording], "base")
    _, e = model_errors(model, [recording])
    whole = np.degrees(recording.angle - model.predict(recording, 1.0))
    run = max(usable_runs(recording, 0), key=lambda r: r.stop - r.start)
    rmse = np.sqrt((whole[run.start + 750 : run.stop] ** 2).mean(axis=0))
    found = np.degrees(np.sqrt(mean_square(e[:, HORIZONS_S.index(1.0)])))
    assert found == pytest.approx(rmse, rel=0.05)


def test_a_prediction_that_diverges_errs_by_five_turns(recording: Recording) -> None:
    """With a damping of −50 N·m·s/rad, J = 0.9 kg·m² doubles its rate every 13 ms."""
    names = ("friction.viscous.roll",)
    model = nominal(recording.profile, names)
    model = replace(model, values=np.append(model.values[:-1], -50.0))
    _, e = model_errors(model, [recording])
    roll = e[:, HORIZONS_S.index(3.0), 0]
    ends = np.isfinite(roll)
    assert ends.sum() > 0.9 * len(ends)
    assert np.abs(roll[ends]) == pytest.approx(np.radians(1800.0))


def test_the_right_model_reaches_the_noise_floor_and_the_nominal_one_does_not(
    recording: Recording, right: Estimate
) -> None:
    model = model_of(right, [recording], "right")
    fitted = simulation_error(model, [recording])
    wrong = simulation_error(nominal(recording.profile), [recording], truth=model)
    assert fitted.at(1.0, "yaw")[0] == pytest.approx(fitted.at(1.0, "yaw")[1], rel=0.4)
    rmse, floor = wrong.at(1.0, "yaw")
    assert rmse > 1.2 * floor
    assert [w.axis for w in wrong.worst] == ["roll", "pitch", "yaw"]
    assert all(0 <= w.start_s < w.stop_s <= recording.duration for w in wrong.worst)


def test_the_filter_s_covariance_predicts_the_noise_floor(
    recording: Recording, right: Estimate
) -> None:
    """It is therefore used where no flight can be simulated."""
    model = model_of(right, [recording], "right")
    simulated, how = noise_floor_deg(model, [recording], flights=6)
    assert how == "6 flights of the model's own"
    assert covariance_floor_deg(model, [recording]) == pytest.approx(simulated, rel=0.3)
    profile = recording.profile.model_copy(update={"controller": None})
    unknown = replace(recording, profile=profile)
    assert noise_floor_deg(model, [unknown])[1] == "the filter's covariance"


def test_a_model_that_cannot_be_simulated_gets_its_noise_floor_from_the_covariance(
    recording: Recording, right: Estimate, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = model_of(right, [recording], "right")
    monkeypatch.setattr(
        "heli3dof.diagnosis.validation.simulation_error.simulated_flight",
        lambda model, r, rng: r.between(0.0, 0.2),
    )
    monkeypatch.setattr(validation, "coloured_variance", lambda *args: 0.0)
    floor, how = noise_floor_deg(model, [recording])
    assert how == "the filter's covariance"
    assert floor == pytest.approx(covariance_floor_deg(model, [recording]))


def test_table_ii_before_and_after_is_listed_with_the_flight_s_own_values() -> None:
    steps = flight(1213, "steps", 40.0)
    base = fit_greybox(steps, ())
    model = model_of(base, [steps], "base")
    same = replayed(model, model, [steps])
    assert {r.axis for r in same} == {"roll", "pitch", "yaw"}
    roll = next(r for r in same if r.axis == "roll")
    assert roll.overshoot_deg[1] == roll.overshoot_deg[2]
    assert roll.overshoot_deg[1] == pytest.approx(roll.overshoot_deg[0], abs=0.5)
    held = replayed(model, model, [steps.between(0.0, 8.0)])[1]
    assert held.axis == "pitch"
    assert np.isnan(held.overshoot_deg).all()
    assert np.isfinite(held.steady_error_deg).all()
    profile = steps.profile.model_copy(update={"controller": None})
    assert replayed(model, model, [replace(steps, profile=profile)]) == ()
