"""Measures the grey-box estimator on flights of the emulated rig, whose parameters are known.

The emulated rig shares no code with the estimator's model.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

import numpy as np

from tests.bench import Figure, at_least, at_most

SEEDS = range(1, 25)
REPLAY_SEEDS = range(1, 9)
START_SEEDS = range(1, 9)
PROCESSES = 2
REPLAYED = ",motor.thrust_gain:1.1,mass.imbalance:0.08"
"""Deviations of base parameters in the replayed flights, equal for every seed"""

TITLE = "Grey-box identification"
INTRO = """
Flights of the mock rig with `hide=motor.lag:0.1, stiffness.pendulum.roll:1.0,
stiffness.pendulum.pitch:0.01, friction.viscous.roll:0.05, friction.viscous.pitch:0.01,
friction.viscous.yaw:0.1` and `spread=0.1` (thrust gain, gravity torque and inertias drawn within 10
% of the profile's), seeds 1 to 24. Twelve parameters are estimated from each: T_g, three inertias,
those six and two constant torques whose true value is zero. CRB is the Cramér–Rao bound at the true
parameters, with the true process noise and encoder rounding as white noise; an estimator that uses
the times of the encoder edges may be below it. Coverage: share of the 95 % intervals that contain
the true value. *10° step*: `run-step --roll 10` of the same rigs without hidden effects, whose
encoders are on a limit cycle.
"""


def one_fit(job: tuple[int, str, float]) -> dict[str, Any]:
    """Fit one flight (``job``: seed, plan, noise scale).

    Returns errors, standard deviations and Cramér–Rao bounds in the estimator's coordinates.
    """
    from heli3dof.identification.greybox.estimate import cramer_rao
    from heli3dof.identification.greybox.method import fit_greybox
    from heli3dof.model.effects import effects, term
    from tests.identification.greybox_score_test import score_test
    from tests.identification.known_flights import fly

    seed, plan, noise = job
    flight = fly(seed, plan, noise=noise, rate_hz=500.0)
    result = fit_greybox(flight.recording)
    problem = result.problem
    truth = problem.structure.scaled(np.array([flight.truth[f.name] for f in result.free]))
    on = {t.effect.name for t in result.structure.terms}
    absent = [
        f"{e.name}.{a}" if a else e.name
        for e in effects().values()
        for a in (e.axes or ("",))
        if len(e.parameters) == 1 and e.screened and e.name not in {*on, *REDUNDANT}
    ]
    return {
        "error": result.optimum.theta - truth,
        "sd": result.std / result.slopes,
        "bound": cramer_rao(problem, truth, flight.noise),
        "lag": float(result.values[list(result.structure.names).index(LAG)]) / 0.1 - 1,
        "noise": result.optimum.noise[:3] / flight.noise[:3],
        "converged": result.optimum.converged,
        "false": max(score_test(result, term(n)).score for n in absent),
    }


LAG = "motor.lag.time_constant_s"
REDUNDANT = {
    "motor.thrust_gain", "mass.imbalance", "inertia", "motor.spin_up", "motor.saturation",
}  # fmt: skip
"""Not score-tested: they duplicate base parameters, or their initial score is uninformative"""


def one_replay(seed: int) -> np.ndarray:
    """Returns (2, 3) fits in %: replay of a held-out flight by the model and by the true rig."""
    from heli3dof.identification.greybox.method import fit_greybox, model_of
    from heli3dof.model.control.loop_task import loop_task, under_control
    from tests.identification.known_flights import HIDDEN, fly

    def flown(seed: int, noise: float = 1.0) -> Any:
        return fly(
            seed, "multisine", spread=0.0, hide=HIDDEN + REPLAYED, noise=noise, rate_hz=500.0
        ).recording

    model = model_of(fit_greybox(flown(seed)), [], "greybox")
    other = under_control(flown(seed + 100))
    still = under_control(flown(seed + 100, noise=0.0))
    y, n = other.angle, len(other)
    replayed = model.fly(loop_task(other)).angle
    spread = np.sqrt(((y - y.mean(axis=0)) ** 2).sum(axis=0))
    return np.array(
        [100 * (1 - np.sqrt(((y - z[:n]) ** 2).sum(axis=0)) / spread)
         for z in (replayed, still.angle)]
    )  # fmt: skip


def one_step(seed: int) -> np.ndarray:
    """Returns (2, 4): errors of T_g and the inertias in standard deviations, plain and corrected.

    The rig has no friction, so its encoders are on a limit cycle for most of the flight.
    """
    from heli3dof.experiment.plan import step_plan
    from heli3dof.identification.closed_loop_fit.identify_correction import without_bias
    from heli3dof.identification.greybox.method import fit_greybox
    from tests.identification.known_flights import fly

    flight = fly(seed, step_plan((10.0, None, None)), hide="", rate_hz=500.0)
    plain = fit_greybox(flight.recording)
    truth = np.array([flight.truth[f.name] for f in plain.free[:4]])
    fits = (plain, without_bias(plain, [flight.recording]))
    return np.array([(f.values[:4] - truth) / f.std[:4] for f in fits])


def one_start(seed: int) -> float:
    """Returns how far the optima from nominal and random start differ, in standard deviations."""
    from heli3dof.identification.greybox.maximum_likelihood import maximise
    from heli3dof.identification.greybox.method import fit_greybox
    from tests.identification.known_flights import fly

    result = fit_greybox(fly(seed, "multisine", rate_hz=500.0).recording)
    rng = np.random.default_rng(seed)
    theta = result.problem.prior_mean.copy()
    for j, f in enumerate(result.free):
        factor = np.exp(rng.uniform(-1, 1) * np.log(2))
        if f.log:
            theta[j] += np.log(factor)
        elif f.name == "T_g":
            theta[j] *= factor
        else:
            theta[j] = factor * f.scaled(f.typical)
    again = maximise(result.problem, theta)
    sd = result.std / result.slopes
    return float(np.abs((again.theta - result.optimum.theta) / sd).max())


def fit_seconds() -> float:
    """Returns CPU s of a fit of a 90 s recording at 500 Hz, including confidence intervals."""
    from heli3dof.identification.greybox.method import fit_greybox
    from tests.identification.known_flights import fly, long_plan

    recording = fly(1, long_plan(), rate_hz=500.0).recording
    fit_greybox(recording)
    start = time.process_time()
    result = fit_greybox(recording)
    assert np.isfinite(result.std).all()
    assert np.isfinite(result.bound).all()
    return time.process_time() - start


def measure() -> list[Figure]:
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    with ProcessPoolExecutor(PROCESSES, mp_context=get_context("spawn")) as pool:

        def all_of(work: Callable[[Any], Any], jobs: list[Any]) -> list[Any]:
            return list(pool.map(work, jobs))

        seconds = pool.submit(fit_seconds).result()
        figures = []
        for name, plan, noise, bar, low in (
            ("multisine", "multisine", 1.0, 1.15, 0.92),
            ("multisine, five times the process noise", "multisine", 5.0, None, 0.92),
            ("steps alone", "steps", 1.0, 1.3, 0.90),
        ):
            fits = all_of(one_fit, [(s, plan, noise) for s in SEEDS])
            figures += _statistics(name, fits, bar, low)
            if plan == "steps":
                lag = float(np.sqrt(np.mean([f["lag"] ** 2 for f in fits])))
                worst = max(abs(f["lag"]) for f in fits)
                figures.append(
                    at_most("rotor lag, RMS error, steps alone", 100 * lag, 4.0, "%",
                            how=f"worst of {len(fits)}: {100 * worst:.2g} %")
                )  # fmt: skip
            false = sorted(f["false"] for f in fits)
            figures.append(
                Figure(f"largest score of an absent effect, {name}", f"{false[-1]:.3g}",
                       how=f"χ², largest of about 20; median {np.median(false):.2g}")
            )  # fmt: skip
        fit = np.mean(all_of(one_replay, list(REPLAY_SEEDS)), axis=0)
        for i, axis in enumerate(("roll", "pitch", "yaw")):
            figures.append(
                at_most(f"closed-loop replay, fit below the true model's, {axis}",
                        float(fit[1, i] - fit[0, i]), 0.5, "points",
                        how=f"{fit[0, i]:.2f} % against {fit[1, i]:.2f} %, held-out flights, "
                        f"seeds {REPLAY_SEEDS[0] + 100} to {REPLAY_SEEDS[-1] + 100}")
            )  # fmt: skip
        steps = np.array(all_of(one_step, list(SEEDS)))
        for name, z in zip(("without", "with"), steps.transpose(1, 0, 2), strict=True):
            inside = (np.abs(z) < 1.96).mean(axis=0)
            figures.append(
                Figure(f"10° step: coverage of 95 % intervals, {name} bias correction",
                       f"{inside.mean():.3g}",
                       how="T_g, roll, pitch, yaw inertia "
                       + ", ".join(f"{x:.2g}" for x in inside)
                       + f"; largest error {np.abs(z).max():.1f} standard deviations")
            )  # fmt: skip
        away = max(all_of(one_start, list(START_SEEDS)))
    figures.append(
        at_most("starts × 0.5 … × 2: largest distance from the optimum", away, 0.1, "std",
                how=f"every start parameter drawn at random, {len(START_SEEDS)} flights")
    )  # fmt: skip
    figures.append(
        at_most("time to fit 90 s at 500 Hz", seconds, 5.0, "s", how="CPU time, one core")
    )
    return figures


def _statistics(name: str, fits: list[Any], bar: float | None, low: float) -> list[Figure]:
    error = np.array([f["error"] for f in fits])
    sd, bound = (np.array([f[k] for f in fits]) for k in ("sd", "bound"))
    ratio = float(np.sqrt(((error / bound) ** 2).mean()))
    inside = float((np.abs(error) < 1.96 * sd).mean())
    noise = np.mean([f["noise"] for f in fits], axis=0)
    converged = sum(f["converged"] for f in fits)
    how = f"{len(fits)} flights × {error.shape[1]} parameters; {converged} fits converged"
    what = f"RMS of parameter error / CRB, {name}"
    rms = at_most(what, ratio, bar, "", how=how) if bar else Figure(what, f"{ratio:.3g}", how=how)
    share = at_least(f"coverage of the 95 % intervals, {name}", inside, low, "",
                     how="estimated over true noise "
                     + " / ".join(f"{x:.2f}" for x in noise))  # fmt: skip
    if low >= 0.92:
        share = Figure(share.what, f"{inside:.4g}", "0.92 … 0.98", low <= inside <= 0.98, share.how)
    return [rms, share]
