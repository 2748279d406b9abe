"""Simulate a recording's closed-loop flight on a fitted model with its process noise.

The simulation has the recording's references, extra voltages, controller (and its delay, see
`heli3dof.model.control.voltage_replay`), sample times and encoder steps. In each step h (s) it adds
random changes of the rates q̇ and angles q:

    Δq̇ = a √h ξ,     Δq = h/2 Δq̇,     ξ ~ N(0, 1),     a: the fitted noise, rad/s²/√Hz

The flight starts at rest at the recording's first angles. The simulation also covers the control
periods that were not logged: between the rows of a decimated log (every m-th sample), and in gaps
of `recording.gap_filling.HOLE_S` or more. The simulation has no sampling jitter, and no mechanical
stops except the table.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache

import numpy as np

from heli3dof.model.base import LoopTask
from heli3dof.model.control.voltage_replay import is_late
from heli3dof.model.estimation.decimated_log import with_loop_rows
from heli3dof.model.greybox.closed_loop import fly, on_table
from heli3dof.model.greybox.model import GreyBoxModel, nominal
from heli3dof.recording.gap_filling import HOLE_S
from heli3dof.recording.recording import Recording

STEP_S = 0.25
"""s: spacing of the instants that `reference_changes` compares. Chosen."""
SETTLED_S = 8.0
"""s: `reference_changes` searches this long before the end of a gap. It is the settling time of the
default loop: after an earlier step, the angles at the end of the gap are those of steady state."""
COMPARED_S = 2.0
"""s: time after a gap in which simulated and recorded angles are compared. Chosen."""


def simulated_flight(
    model: GreyBoxModel, recording: Recording, rng: np.random.Generator, rows: int | None = None
) -> Recording:
    """Return the first ``rows`` rows of the recording, simulated with noise from ``rng``.

    ``rows`` = None: all rows. The angles are quantised: they differ from the first recorded ones by
    whole encoder steps. Raises ValueError if the recording lacks an angle or its controller is
    unknown.
    """
    if recording.controller is None or len(recording.axes) < 3:
        raise ValueError("the controller of this recording is unknown, or an angle is missing")
    n = len(recording) if rows is None else min(rows, len(recording))
    logged = recording.rows(slice(0, n))
    changes = {k: t for k, t in reference_changes(recording).items() if k + 1 < n}
    part, at = with_loop_rows(logged, changes)
    h = np.append(np.diff(part.t), part.profile.dt)
    task = _loop_task(part)
    grid = np.abs(part.profile.encoder.rad_per_count)
    offset = None if on_table(task.angle0) else rng.uniform(-0.5, 0.5, 3) * grid
    kick = rng.standard_normal((len(part), 3)) * model.noise * np.sqrt(h)[:, None]
    late = is_late(recording)
    flown = fly(model, task, t=part.elapsed_s, offset=offset, kick=kick, late=late)
    angle = task.angle0 + np.rint((flown.angle - task.angle0) / grid) * grid
    return replace(logged, angle=angle[at], voltage=flown.voltage[at])


def _loop_task(part: Recording) -> LoopTask:
    """Return the input of a simulated flight with one control period per row of ``part``."""
    profile = part.profile
    assert part.controller is not None
    return LoopTask(
        part.reference, part.controller_input, np.array(part.angle[0]), part.controller,
        profile.motor.V_o, profile.motor.v_max, profile.dt,
        np.abs(profile.encoder.rad_per_count),
    )  # fmt: skip


def reference_changes(recording: Recording) -> Mapping[int, float]:
    """Return {k: t}: the references changed at the time t (s), in the gap of the log after row k.

    A gap of `HOLE_S` or more has an entry if the references before and after it differ. The
    function assumes that all references change at one instant t of the gap. A grid search with the
    step `STEP_S` over the last `SETTLED_S` of the gap estimates t. For each t, the function
    simulates the flight with the profile's parameters and without noise. The error of a simulation
    is the sum of squared differences from the recorded angles in the `COMPARED_S` after the gap.
    The estimate is the t with the smallest error.
    """
    holes = tuple(
        int(k)
        for k in np.flatnonzero(np.diff(recording.t) >= HOLE_S)
        if not np.array_equal(recording.reference[k], recording.reference[k + 1], equal_nan=True)
    )
    return _estimated_changes(recording, holes) if holes else {}


@lru_cache(maxsize=16)  # every simulated flight of a recording needs them
def _estimated_changes(recording: Recording, holes: tuple[int, ...]) -> Mapping[int, float]:
    """Return {k: t}: the references changed at the time t (s), in the gap of the log after row k.

    ``holes`` contains the numbers k of these rows. `reference_changes` explains the method.
    """
    changes: dict[int, float] = {}
    t = recording.t
    for k in holes:
        part = recording.rows(slice(0, int(np.searchsorted(t, t[k + 1] + COMPARED_S))))
        instants = np.arange(t[k + 1], max(t[k], t[k + 1] - SETTLED_S), -STEP_S)
        misfits = [_misfit(part, {**changes, k: float(s)}, k + 1) for s in instants]
        changes[k] = float(instants[np.argmin(misfits)])
    return changes


def _misfit(recording: Recording, changes: Mapping[int, float], first: int) -> float:
    """Return the sum of squared differences (rad²) between simulated and recorded angles.

    The sum begins at the row ``first``. ``changes`` {k: t}: in the gap of the log after row k, the
    simulated references change at the time t (s). The simulation has the profile's parameters and
    no noise. If it diverges, the result is infinite.
    """
    part, at = with_loop_rows(recording, changes)
    flown = fly(
        nominal(recording.profile), _loop_task(part), t=part.elapsed_s, late=is_late(recording)
    )
    difference = (flown.angle[at] - recording.angle)[first:]
    misfit = float(np.nansum(difference**2))
    return misfit if np.isfinite(flown.angle).all() else np.inf
