"""One look at recordings from one point (θ, a): score, information, and slopes along the noise.

    g = ∂ℓ/∂θ,   H = Σ w ∂c ∂cᵀ,   s_i = ∂ℓ/∂ ln a_i ≈ (ℓ_i(a e^δ) − ℓ_i(a e^−δ)) / 2δ

ℓ is the filter's log-likelihood (`heli3dof.identification.greybox.likelihood`), its tangents ∂c/∂θ
those of first-order perturbation (`sensitivity.perturbation`); s and its curvature are taken
axis by axis over a step δ, since the likelihood is a little rough. The three passes of the filter
are shared out (`heli3dof.parallel`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from heli3dof.diagnosis.sensitivity.perturbation import Path, forcing, forward, path
from heli3dof.identification.greybox.likelihood import (
    DIFFERENCE,
    Likelihood,
    Pass,
    diverged,
    score_and_information,
)
from heli3dof.model.physics.state_layout import Stage
from heli3dof.parallel import parallel_map

_PROBE = 0.5  # step of the log intensity, as in `fit`
HELD = ("mass.change.time_s",)
"""Where a scan puts it: the likelihood along an instant is too jagged to climb."""
COARSE = {"mass.change.time_s": 5e-3}
"""Steps of the differences where a hundredth of a second must show (in typical sizes)."""


@dataclass(frozen=True, eq=False)
class Evaluation:
    """One set of recordings at one point: n coordinates."""

    at: Pass
    path: Path
    T: np.ndarray
    """(n, E) ∂c/∂θ"""
    g: np.ndarray
    H: np.ndarray
    slope: np.ndarray
    """(3,) of ℓ along the log noise intensities"""
    bend: np.ndarray
    """(3,) and its curvature, negative"""


def evaluate(
    problem: Likelihood, theta: np.ndarray, noise: np.ndarray, *, whole: bool = True
) -> Evaluation:
    """Score and information there; without ``whole`` nothing about the noise."""
    factor = np.array([np.exp(_PROBE)] * 3 + [1.0])

    def centre() -> Evaluation:
        at = problem.run(theta, noise, keep=2)
        p = path(problem.structure, problem.values(theta), problem.data, at)
        T = tangents(problem, theta, p)
        g, H = score_and_information(at, T)
        return Evaluation(at, p, T, g, H, np.zeros(3), np.full(3, -1.0))

    def part(i: int) -> Any:
        if i == 0:
            return centre()
        return problem.run(theta, noise * factor if i == 1 else noise / factor, keep=0).loglik

    if not whole:
        return centre()
    here: Evaluation
    here, up, down = parallel_map(part, 3)
    mid = here.at.loglik
    known = np.isfinite(up) & np.isfinite(mid) & np.isfinite(down)
    up, mid, down = (np.where(known, each, 0.0) for each in (up, mid, down))
    bend = np.where(known, (up - 2 * mid + down) / _PROBE**2, -1.0)
    return replace(here, slope=(up - down) / (2 * _PROBE), bend=bend)


def held(problem: Likelihood) -> np.ndarray:
    """(n,) bool: which parameters stay where they are."""
    return np.array([f.name in HELD for f in problem.structure.free])


def tangents(problem: Likelihood, theta: np.ndarray, p: Path) -> np.ndarray:
    """(n, E) ∂c/∂θ by `perturbation`; of what changes the readings by `Likelihood.tangents`.

    First-order perturbations diverge beside a dry friction below zero, which pushes: its slope at
    rest is steep, and acts for as long as the perturbed rig is off the path. The simulation itself
    slips out of it, so there its differences are taken, by `Likelihood.tangents` too.
    """
    s = problem.structure
    by_name = {t.name: t for t in s.terms}
    read = np.array(
        [f.term is not None and Stage.MEASURE in by_name[f.term].effect.hooks for f in s.free]
    )
    moves = [
        f.term is not None
        and bool({Stage.SETUP, Stage.VOLTAGE} & set(by_name[f.term].effect.hooks))
        for f in s.free
    ]
    out = np.zeros((len(theta), len(p.at.row)))
    direct = np.flatnonzero(~read)
    _, high = problem.bounds
    step = np.array([COARSE.get(f.name, DIFFERENCE) for f in s.free])
    step = np.where(theta + step > high, -step, step)
    sets = []
    for j in direct:
        e = np.zeros(len(theta))
        e[j] = step[j]
        sets.append(problem.values(theta + e))
    a = forcing(p, s, sets, [moves[j] for j in direct])
    with np.errstate(over="ignore", invalid="ignore"):
        out[direct] = forward(p, a / step[direct, None, None])
    simulated = read | diverged(out)
    if simulated.any():
        out[simulated] = problem.tangents(theta, p.at, np.flatnonzero(simulated))
    return out
