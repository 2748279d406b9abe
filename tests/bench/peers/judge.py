"""Scores every fit in the same way: replayed loops, one step, poles, parameters, coverage.

- *replay*: fit % per axis of the simulated closed loop with the references of held-out flights;
- *one step*: fit % of predictions 40 ms ahead on the same flights, the lowest axis. It is near 100
  for every model, and shown only for comparison;
- *poles*: the model's poles s about level hover. Each true pole ŝ is paired with one of them so
  that the sum of |s − ŝ| / (|s| + |ŝ| + 0.1 rad/s) is least. The *rotor* column is the mean error
  of the two at −1/τ in % (of one where the model has only one). *Body* is the RMS distance in rad/s
  of the five others without the yaw integrator, *drift* that integrator's distance from zero;
- *parameters*: median of |error| in % over the ten of `rigid.NAMES`;
- *coverage*: number of 95 % intervals that contain the true value: of the ten parameters if a
  fit has them, else of the real and imaginary parts of its poles.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from heli3dof.identification import validation
from heli3dof.identification.black_box.pbsid import StateSpace
from heli3dof.identification.black_box.resampling import NoContinuousModel, at_rate
from heli3dof.identification.preprocessing import Prepared, prepare
from heli3dof.model.base import Model
from heli3dof.model.discretisation import c2d_zoh
from heli3dof.model.linear.model import LinearModel
from heli3dof.model.model_file import read_model
from heli3dof.recording.recording import Recording
from tests.bench.peers import rigid
from tests.bench.peers.interface import Found
from tests.bench.peers.rigid_model import RigidModel

ONE_STEP_S = 0.04
NORMAL_95 = 1.959964
SLOW_RAD_S = 0.1
"""rad/s, the constant in the pairing of poles: differences far below it do not matter"""


@dataclass(frozen=True, eq=False)
class Verdict:
    """The scores of a fit; NaN, or 0 of 0, where there is none."""

    replay: np.ndarray
    """(3,) %"""
    one_step: float
    """%"""
    rotor_percent: float
    body_rad_s: float
    drift_rad_s: float
    errors: np.ndarray
    """(10,) relative errors of the parameters, or (0,)."""
    covered: tuple[int, int]
    """(number of intervals that contain the true value, number of intervals)"""


def judge(found: Found, truth: np.ndarray, known: np.ndarray, held_out: Prepared) -> Verdict:
    """Returns the scores of a fit ``found`` on held-out flights."""
    try:
        linear = linear_model(found, known, held_out.dt)
    except NoContinuousModel:
        return Verdict(np.full(3, np.nan), *[np.nan] * 4, np.empty(0), (0, 0))
    flown: object = linear
    if found.kind == "physical":
        file = found.arrays.get("model_file")
        flown = RigidModel(found.arrays["values"], known) if file is None else read_model(str(file))
    lam = np.linalg.eigvals(linear.A).astype(complex)
    own_s = np.log(np.where(np.abs(lam) < 1e-12, 1e-12, lam)) / linear.dt
    rotor, body, drift = pole_errors(own_s, true_poles(truth, known))
    errors, covered = np.empty(0), (0, 0)
    if found.kind == "physical":
        values, stds = found.arrays["values"], found.arrays["stds"]
        errors = values / truth - 1
        if np.isfinite(stds).any():
            covered = int((np.abs(values - truth) <= NORMAL_95 * stds).sum()), len(truth)
    elif "poles" in found.arrays and np.isfinite(found.arrays["poles"][:, 2:]).any():
        covered = poles_covered(found.arrays["poles"], true_poles(truth, known))
    return Verdict(
        replay_fit(flown, held_out), one_step_fit(linear, held_out), rotor, body, drift, errors,
        covered,
    )  # fmt: skip


def flights(recordings: list[Recording]) -> Prepared:
    """Returns held-out flights as `judge` takes them."""
    return prepare(recordings, held_out=recordings)


def replay_fit(model: object, held_out: Prepared) -> np.ndarray:
    """Returns the (3,) replay fit in %, pooled over the flights."""
    return validation.score(validation.replays(model, held_out, held_out.held_out)).fit_percent  # type: ignore[arg-type]


def replay_of(quiet: list[Recording], held_out: Prepared) -> np.ndarray:
    """Returns the (3,) replay fit in % of the true rig itself: of its flights without noise."""
    pairs = []
    for run in held_out.held_out:
        rows = slice(run.start, run.stop)
        pairs.append(
            (
                held_out.recordings[run.source].angle[rows],
                quiet[run.source % len(quiet)].angle[rows],
            )
        )
    return validation.score(pairs).fit_percent


def one_step_fit(model: Model, held_out: Prepared) -> float:
    """Returns the *one step* score in %, that of the lowest axis."""
    with np.errstate(over="ignore", invalid="ignore"):
        pairs = validation.predictions(model, held_out, held_out.held_out, ONE_STEP_S)
    return float(validation.score(pairs).fit_percent.min())


def linear_model(found: Found, known: np.ndarray, dt: float) -> LinearModel:
    """Returns the fit as a linear model at the control rate; a physical one about level hover.

    Raises NoContinuousModel where a discrete fit has a mode that no continuous one has.
    """
    a = found.arrays
    if found.kind == "physical":
        A, B = c2d_zoh(*rigid.linearised(a["values"], known), dt)
        V_h = a["values"][3] / (2 * known[0] * known[2])
        return _model(found, A, B, np.eye(3, 8), np.full(2, V_h), np.zeros(3), dt)
    if found.kind == "continuous":
        # ẋ = A (x − x0) + B (u − u0): the smallest x0, u0 equivalent to the constant c
        A, B = a["A"], a["B"]
        trim = -np.linalg.lstsq(np.hstack([A, B * 20.0]), a["c"], rcond=1e-6)[0]
        n = len(A)
        A_d, B_d = c2d_zoh(A, B, dt)
        return _model(found, A_d, B_d, a["C"], 20.0 * trim[n:], a["C"] @ trim[:n], dt)
    if found.kind == "exact":
        zero = np.zeros((len(a["A"]), 3))
        return LinearModel(
            "fit", "statespace", a["A"], a["B"], a["C"], a.get("K", zero), a["S"], a["u0"],
            a["y0"], dt,
        )  # fmt: skip
    fast = at_rate(
        StateSpace(a["A"], a["B"], a["C"], a["K"], np.zeros(3), a["S"]), float(a["interval_s"]), dt
    )
    # A feedthrough D acts one control period later, the earliest time in a sampled loop.
    n = fast.order
    A = np.zeros((n + 2, n + 2))
    A[:n, :n] = fast.A
    B = np.vstack([fast.B, np.eye(2)])
    K = np.vstack([fast.K, np.zeros((2, 3))])
    return LinearModel(
        "fit", "statespace", A, B, np.hstack([fast.C, a["D"]]), K, fast.S, a["u0"], a["y0"], dt
    )


def _model(
    found: Found, A: np.ndarray, B: np.ndarray, C: np.ndarray, u0: np.ndarray, y0: np.ndarray,
    dt: float,
) -> LinearModel:  # fmt: skip
    return LinearModel(
        "fit", found.kind, A, B, C, np.zeros((len(A), 3)), np.full((3, 3), np.nan), u0, y0, dt,
        exact_hold=True,
    )  # fmt: skip


def true_poles(truth: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Returns the true poles (8,) in rad/s: two rotors, five of the body, the yaw integrator."""
    s = np.linalg.eigvals(rigid.linearised(truth, known)[0]).astype(complex)
    return s[np.argsort(-np.abs(s))]


def paired(own: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Returns the model's pole for each of the 8 true ones; NaN where it has too few."""
    from scipy.optimize import linear_sum_assignment

    # The cost is between 0 and 1, so a missing pole does not change the pairs of the others.
    size = np.abs(own[None, :]) + np.abs(true[:, None]) + SLOW_RAD_S
    rows, columns = linear_sum_assignment(np.abs(own[None, :] - true[:, None]) / size)
    out = np.full(len(true), np.nan, dtype=complex)
    out[rows] = own[columns]
    return out


def pole_errors(own: np.ndarray, true: np.ndarray) -> tuple[float, float, float]:
    """Returns the columns *rotor* (%), *body* and *drift* (rad/s) for a model's poles (rad/s)."""
    near = paired(own, true)
    off = np.abs(near - true)
    rotor = off[:2] / np.abs(true[:2])
    rotor = rotor[np.isfinite(rotor)]
    body = off[2:7]
    return (
        100 * float(rotor.mean()) if len(rotor) else np.nan,
        float(np.sqrt(np.mean(body**2))),
        float(off[7]),
    )


def poles_covered(poles: np.ndarray, true: np.ndarray) -> tuple[int, int]:
    """Returns how many intervals contain their true value, and the number of intervals.

    ``poles``: (n, 4) in rad/s: real part, imaginary part, and their standard deviations.
    """
    own = poles[:, 0] + 1j * poles[:, 1]
    held_, total = 0, 0
    for value, target in zip(paired(own, true), true, strict=True):
        if np.isnan(value):
            total += 1  # a pole that the model does not have is not covered
            continue
        _, _, std_re, std_im = poles[int(np.argmin(np.abs(own - value)))]
        for off, std in ((value.real - target.real, std_re), (value.imag - target.imag, std_im)):
            if np.isfinite(std) and std > 0:
                total += 1
                held_ += int(abs(off) <= NORMAL_95 * std)
    return held_, total
