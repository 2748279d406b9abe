"""Check whether a maximum-likelihood fit to recordings is valid.

Sampling jitter and unmodelled fast motion make the fit invalid. One step ahead, unmodelled motion
looks like a random torque, and the fit estimates a corresponding process noise. White angular
acceleration of intensity a_i (rad/s²/√Hz) on axis i accumulates: h seconds after a known state, the
angle has the standard deviation

    σ_i(h) = a_i √(h³/3)

If predictions are more accurate than σ_i(h), the torque is not white: for example, a vibration
changes sign from sample to sample. Then the likelihood, its standard deviations and its choice of
causes cannot be trusted. The likelihood is rejected if, on any axis, both hold:

* a_i exceeds `TIMES` × the intensity of known rigs (`heli3dof.model.greybox.prediction.NOISE`).
* σ_i(`HORIZON_S`) exceeds `OVER` × the RMSE of predictions `HORIZON_S` ahead. The predictions are
  those of the rigid body, refitted to the recordings.

Encoder backlash alone meets only the second condition, a missing effect alone only the first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.axes import AXES
from heli3dof.identification.fit_result import FitResult, Request
from heli3dof.identification.greybox import freeflight, method
from heli3dof.identification.greybox.estimate import estimate
from heli3dof.identification.greybox.freeflight import LEAST_WINDOWS, flight_of
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.identification.greybox.maximum_likelihood import compile_first
from heli3dof.identification.greybox.method import has_jitter, model_of
from heli3dof.identification.preprocessing import Prepared
from heli3dof.identification.row_selection import usable_runs
from heli3dof.model.estimation.filter_data import data_of
from heli3dof.model.greybox.prediction import NOISE, errors, filtered
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.recording.recording import Recording

HORIZON_S = 1.0
TIMES = 5.0
OVER = 1.5
"""`TIMES` and `OVER` are the factors in the two conditions of the module. Chosen; not derived."""
FAR = np.pi
"""rad: larger prediction errors are replaced by this value."""
CLOCK = (
    "The time stamps of these logs are even, but the motion shows that the samples were not: "
    "sampling jitter. One step ahead it acts as noise in proportion to the rate, which biases "
    "every inertia and thrust parameter."
)


@dataclass(frozen=True, eq=False)
class NoiseCheck:
    """Result of `noise_check`: process noise and prediction errors of the fitted rigid body."""

    noise: np.ndarray
    """(3,) intensity of the process noise on roll, pitch, yaw, rad/s²/√Hz"""
    rmse_deg: np.ndarray
    """(3,) RMSE of predictions `HORIZON_S` ahead, degrees, by axis"""

    @property
    def expected_deg(self) -> np.ndarray:
        """Return the RMSE (3,) in degrees that white process noise would cause on each axis.

        It is the RMSE of predictions `HORIZON_S` ahead, for white noise of the fitted intensity.
        """
        return np.asarray(np.degrees(self.noise * np.sqrt(HORIZON_S**3 / 3)))

    @property
    def overstated(self) -> np.ndarray:
        """Return (3,) bool: True for each axis on which the fit overstates the process noise.

        There the noise is more than `TIMES` times that of known rigs. It also implies prediction
        errors (`expected_deg`) of more than `OVER` times the actual ones (``rmse_deg``).
        """
        loud = self.noise > TIMES * NOISE
        return np.asarray(loud & (self.expected_deg > OVER * self.rmse_deg))

    @property
    def usable(self) -> bool:
        """Return True if a maximum-likelihood fit is valid.

        It is valid if the fit overstates the process noise on no axis (`overstated`).
        """
        return not self.overstated.any()


def noise_check(recordings: Sequence[Recording]) -> NoiseCheck | None:
    """Return process noise and prediction errors of the rigid body, fitted without effects.

    The recordings must be of one rig and contain all three angles. Returns None if they are too
    short for the test. Raises RecordingError if no row is usable.
    """
    flights = [flight_of(r) for r in recordings]
    if sum(len(f.starts) for f in flights) < LEAST_WINDOWS:
        return None
    runs = [run for i, r in enumerate(recordings) for run in usable_runs(r, i)]
    problem = Likelihood(data_of(recordings, runs), Structure(recordings[0].profile, ()))
    compile_first(problem)
    found = estimate(problem)
    model = model_of(found, recordings, "base")
    e = []
    for r, f in zip(recordings, flights, strict=True):
        ahead = np.array([max(1, round(HORIZON_S / r.dt))])
        with np.errstate(all="ignore"):
            states = filtered(model, r)[1]
            e.append(errors(model.structure, model.values, f, states, ahead)[:, 0])
    each = np.clip(np.nan_to_num(np.concatenate(e), nan=FAR, posinf=FAR, neginf=-FAR), -FAR, FAR)
    rmse = np.degrees(np.sqrt((each**2).mean(axis=0)))
    return NoiseCheck(found.optimum.noise[:3].copy(), rmse)


def fit(prepared: Prepared, request: Request) -> FitResult:
    """Return the maximum-likelihood fit, or a multi-step fit if the likelihood is invalid.

    `likelihood_obstacle` tests the training recordings, which have all three angles. If ``request``
    names the terms, the function skips this test and uses the likelihood.
    """
    sources = [prepared.recordings[i] for i in sorted({r.source for r in prepared.train})]
    if request.terms is None and (reason := likelihood_obstacle(sources)):
        if request.name == request.method:  # the default name
            request = replace(request, name=freeflight.METHOD)
        found = freeflight.fit(prepared, request)
        warnings = (f"{reason} {freeflight.INSTEAD}", *found.warnings)
        return replace(found, method=freeflight.METHOD, warnings=warnings)
    return method.fit(prepared, request)


def likelihood_obstacle(recordings: Sequence[Recording]) -> str:
    """Return why a maximum-likelihood fit to ``recordings`` is invalid, or ``""``.

    The fit is invalid in two cases: all recordings have sampling jitter, or the fitted process
    noise is too large (`noise_check`). The noise is tested only if all controllers are unknown.
    """
    if all(has_jitter(r) for r in recordings):
        return CLOCK
    if any(r.profile.controller is not None for r in recordings):
        return ""
    check = noise_check(recordings)
    if check is None or check.usable:
        return ""
    i = int(np.argmax(check.overstated * check.expected_deg / check.rmse_deg))
    return (
        f"The process noise estimated on {AXES[i]} implies errors of "
        f"{check.expected_deg[i]:.0f}° within {HORIZON_S:g} s, but predictions are off by only "
        f"{check.rmse_deg[i]:.0f}°. So it is unmodelled fast motion, not noise, and a likelihood "
        "would report false causes."
    )
