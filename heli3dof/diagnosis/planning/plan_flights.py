"""Simulate plans on a model in closed loop, to compute what the flights would show.

A flight is simulated with the model's noise and encoders (`bias_correction.simulated_flight`),
which needs the references of the whole flight. If a plan opens control loops, the references depend
on the motion: a loop is closed again where its axis then stands. Such a plan is first simulated
without noise, to get these references (`heli3dof.model.control.controller`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from heli3dof.diagnosis.result import MIN_CERTAINTY, percent
from heli3dof.errors import CheckFailed, UsageError
from heli3dof.experiment.plan import Plan, Signals, checked
from heli3dof.experiment.simulate import simulate
from heli3dof.identification.bias_correction.simulated_flight import simulated_flight
from heli3dof.model.control.stability import check_loop
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.recording.recording import Recording, recording_of_arrays
from heli3dof.recording.row import CLOSED_LOOP
from heli3dof.rig.envelope import Envelope
from heli3dof.rig.profile import Profile

MOST_FLIGHTS = 20
"""Largest number of flights that are recommended; beyond it, measuring by hand is less work."""


@dataclass(frozen=True, eq=False)
class Task:
    """A plan, converted to a rig's references in each control period, to be simulated on models."""

    plan: Plan
    signals: Signals
    profile: Profile
    seed: int


def task_of(plan: Plan, profile: Profile, seed: int) -> Task | None:
    """Return the plan as references for a rig; None if it fails a check (e.g. safety envelope).

    If the profile's controller is unknown, the default one is used.
    """
    profile = profile.with_controller()
    try:
        signals = checked(plan, profile, seed)
    except (UsageError, CheckFailed):
        return None
    return Task(plan, signals, profile, seed)


def is_stable(model: GreyBoxModel) -> bool:
    """Return True if the controller of the model's profile stabilises the model."""
    profile = model.profile
    controller = profile.with_controller().controller
    assert controller is not None
    try:
        check_loop(model, controller, profile.dt)
    except (UsageError, CheckFailed):
        return False
    return True


def fly_task(task: Task, model: GreyBoxModel) -> Recording | None:
    """Return the task's flight on ``model``, simulated in closed loop with noise.

    The profile's controller must stabilise the model (`is_stable`). The result is None if the
    flight leaves the envelope, or if `simulate` raises an error for a plan that opens control
    loops.
    """
    if task.signals.opened is None:
        references = _reference_recording(task)
    else:
        try:
            references = simulate(task.plan, model, profile=task.profile, seed=task.seed)
        except (UsageError, CheckFailed):
            return None
    flight = simulated_flight(model, references, np.random.default_rng([task.seed, 5]))
    return flight if inside_envelope(flight) else None


def inside_envelope(flight: Recording) -> bool:
    """Return True if the flight's angles stay inside its profile's safety envelope."""
    envelope, rates, volts = Envelope(flight.profile), (0.0, 0.0, 0.0), (0.0, 0.0)
    ends = (flight.angle.min(axis=0).tolist(), flight.angle.max(axis=0).tolist())
    return all(envelope.check(0.0, a, rates, volts, volts) is None for a in ends)


def _reference_recording(task: Task) -> Recording:
    """Return a recording at rest on the table, with the plan's references and extra voltages."""
    s = task.signals
    n = len(s.t)
    rest = np.tile(task.profile.encoder.rest_rad, (n, 1))
    return recording_of_arrays(
        s.t, np.zeros((n, 2)), rest, task.profile,
        reference=s.reference, voltage_extra=s.extra,
        channels={"phase": np.full(n, float(CLOSED_LOOP))},
    )  # fmt: skip


def flights_needed(certainty: Callable[[int], float]) -> str:
    """Return, as text, the number of flights after which a decision is likely (`MIN_CERTAINTY`).

    ``certainty`` returns the probability of a decision after a number of flights.

    >>> flights_needed(lambda flights: flights / 6)
    '3 such flights decide with a probability of 50 %. Or measure one effect by hand'
    >>> flights_needed(lambda flights: 0.1)
    'Not even 20 such flights decide with a probability of 50 %: measure one effect by hand'
    """
    decide = f"such flights decide with a probability of {percent(MIN_CERTAINTY)}"
    for flights in range(2, MOST_FLIGHTS + 1):
        if certainty(flights) >= MIN_CERTAINTY:
            return f"{flights} {decide}. Or measure one effect by hand"
    return f"Not even {MOST_FLIGHTS} {decide}: measure one effect by hand"
