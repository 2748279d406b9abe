"""How wrong a model is 1 s ahead from re-estimated states, and what an extension gains.

    RMSE_i = √(mean (y_i[k] − ŷ_i[k | angles to k − 1 s, voltages throughout])²)

Never an open-loop replay from the start: the plant integrates twice. The noise floor is the same
error of the extended model on flights of its own (its process noise and encoders, nothing else).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.noisy_flight import noisy_flight
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.identification.greybox.method import usable_runs
from heli3dof.model.filtering import data_of
from heli3dof.model.greybox import GreyBoxModel
from heli3dof.recording.recording import Recording

HORIZON_S = 1.0


def rmse_deg(model: GreyBoxModel, recordings: Sequence[Recording]) -> dict[str, float | None]:
    """By axis, in degrees; None where it was not measured."""
    squares: list[list[np.ndarray]] = [[], [], []]
    for i, r in enumerate(recordings):
        errors = r.angle - model.predict(r, HORIZON_S)
        skip = round(HORIZON_S / r.dt)
        for run in usable_runs(r, i):
            for a in range(3):
                squares[a].append(errors[run.start + skip : run.stop, a] ** 2)
    out: dict[str, float | None] = {}
    for a, axis in enumerate(AXES):
        e = np.concatenate(squares[a]) if squares[a] else np.zeros(0)
        e = e[np.isfinite(e)]
        out[axis] = float(np.degrees(np.sqrt(e.mean()))) if len(e) else None
    return out


def noise_floor_deg(
    model: GreyBoxModel, recordings: Sequence[Recording], seed: int = 0
) -> dict[str, float | None]:
    """The error that is left where the model is the truth; empty where the loop is unknown."""
    try:
        rng = np.random.default_rng([seed, 77])
        flown = [noisy_flight(model, r, rng) for r in recordings]
    except ValueError:
        return dict.fromkeys(AXES)
    return rmse_deg(model, flown)


def log_likelihood(model: GreyBoxModel, recordings: Sequence[Recording]) -> float:
    """Σ ln Z of the recordings under the model as it stands."""
    runs = [run for i, r in enumerate(recordings) for run in usable_runs(r, i)]
    problem = Likelihood(data_of(recordings, runs), model.structure)
    noise = np.append(model.noise, model.jitter_s)
    return float(problem.run(problem.coordinates(model.values), noise, keep=0).loglik.sum())
