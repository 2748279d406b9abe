"""Whether what the likelihood calls noise is noise: a real rig's unmodelled motion is not white.

One step ahead whatever a model lacks looks like random torque, and the likelihood makes its noise
as large as that. White torque of intensity a accumulates: from a known state, after h seconds,

    σ_i(h) = a_i √(h³/3)                     of the angle, on a free axis

A rig that is predicted better than that was not driven by such noise: what changed sign from one
sample to the next (a vibration, thrust that follows the voltage otherwise) was taken for it. The
likelihood, its σ and its names with it, is not believed where on some axis a_i is `TIMES` larger
than rigs are known to have it (`heli3dof.model.greybox.prediction.NOISE`) *and* σ_i over
`HORIZON_S` exceeds the error of the refitted rigid body by `OVER`: an encoder's play alone does the
latter, a cause that is missing the former.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from heli3dof.axes import AXES
from heli3dof.identification.greybox.estimate import estimate
from heli3dof.identification.greybox.freeflight import LEAST_WINDOWS, flight_of
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.identification.greybox.method import (
    clock_lies,
    compile_first,
    model_of,
    usable_runs,
)
from heli3dof.model.estimation.filter_data import data_of
from heli3dof.model.greybox.multistep import errors
from heli3dof.model.greybox.prediction import NOISE, filtered
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.recording.recording import Recording

HORIZON_S = 1.0
TIMES = 5.0
OVER = 1.5
FAR = np.pi
CLOCK = (
    "These logs' clocks are even, but the samples were not taken evenly (found from the motion): "
    "one step ahead that is noise of the rate's size, which pulls every inertia and thrust "
    "parameter off."
)


@dataclass(frozen=True, eq=False)
class NoiseCheck:
    """What the refitted rigid body's noise says of predictions, and what they are."""

    noise: np.ndarray
    """(3,) a, rad/s²/√Hz"""
    rmse_deg: np.ndarray
    """(3,) over `HORIZON_S`"""

    @property
    def expected_deg(self) -> np.ndarray:
        """(3,) σ over `HORIZON_S`"""
        return np.asarray(np.degrees(self.noise * np.sqrt(HORIZON_S**3 / 3)))

    @property
    def overstated(self) -> np.ndarray:
        """(3,) bool: axes whose noise is none"""
        loud = self.noise > TIMES * NOISE
        return np.asarray(loud & (self.expected_deg > OVER * self.rmse_deg))

    @property
    def believed(self) -> bool:
        return not self.overstated.any()


def noise_check(recordings: Sequence[Recording]) -> NoiseCheck | None:
    """Of recordings of one rig with all three angles; None where there is too little free flight.

    Raises RecordingError where nothing is usable.
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
            states = filtered(model, r)[3]
            e.append(errors(model.structure, model.values, f, states, ahead)[:, 0])
    each = np.clip(np.nan_to_num(np.concatenate(e), nan=FAR, posinf=FAR, neginf=-FAR), -FAR, FAR)
    rmse = np.degrees(np.sqrt((each**2).mean(axis=0)))
    return NoiseCheck(found.optimum.noise[:3].copy(), rmse)


def why_freeflight(recordings: Sequence[Recording]) -> str:
    """Why no likelihood may be trusted on recordings whose loop is unknown; empty where it may."""
    if all(clock_lies(r) for r in recordings):
        return CLOCK
    check = noise_check(recordings)
    if check is None or check.believed:
        return ""
    i = int(np.argmax(check.overstated * check.expected_deg / check.rmse_deg))
    return (
        f"One step ahead the rigid body leaves so much over on {AXES[i]} that, were it noise, "
        f"{check.expected_deg[i]:.0f}° would be lost within {HORIZON_S:g} s; the flights are "
        f"predicted to {check.rmse_deg[i]:.0f}°. It is motion that no term holds at that pace, "
        "and a likelihood would explain it with causes that are none."
    )
