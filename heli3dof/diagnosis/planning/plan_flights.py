"""Simulate a plan's flight in closed loop on a model, to predict what a real flight would show.

The flight is simulated with the model's noise and encoders (`bias_correction.simulated_flight`).
The references of the whole flight must be known before. But if a plan opens the control loop of an
axis, the references depend on the motion. While the loop is open, the reference is the measured
angle. After the loop has closed, the reference returns from this angle to that of the plan
(`heli3dof.model.control.controller`). So such a plan is first simulated without noise, to compute
its references.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from heli3dof.diagnosis.result import percent
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
LIKELY = 0.9
"""Probability of a decision for which a number of flights is stated. Chosen."""


@dataclass(frozen=True, eq=False)
class RenderedPlan:
    """A plan with the reference angles and added voltages of each control period of one rig."""

    plan: Plan
    signals: Signals
    """References and added voltages"""
    profile: Profile
    """Profile of the rig"""
    seed: int
    """Seed of random signals and of the simulated noise"""


def rendered_plan(plan: Plan, profile: Profile, seed: int) -> RenderedPlan | None:
    """Return the plan with its reference angles and added voltages for a rig.

    The result is None if the plan fails a check, for example because a reference is outside the
    safety envelope. If the profile's controller is unknown, the default one is used.
    """
    profile = profile.with_controller()
    try:
        signals = checked(plan, profile, seed)
    except (UsageError, CheckFailed):
        return None
    return RenderedPlan(plan, signals, profile, seed)


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


def simulated_plan(p: RenderedPlan, model: GreyBoxModel, number: int = 0) -> Recording | None:
    """Return a flight of the plan on ``model``, simulated in closed loop with noise.

    Flights of different ``number`` have different noise. The profile's controller must stabilise
    the model (`is_stable`). The result is None if the flight leaves the safety envelope. For a plan
    that opens control loops, it is also None if the simulation without noise (`simulate`) raises an
    error.
    """
    if p.signals.opened is None:
        references = _reference_recording(p)
    else:
        try:
            references = simulate(p.plan, model, profile=p.profile, seed=p.seed)
        except (UsageError, CheckFailed):
            return None
    flight = simulated_flight(model, references, np.random.default_rng([p.seed, 5 + number]))
    return flight if inside_envelope(flight) else None


def inside_envelope(flight: Recording) -> bool:
    """Return True if the flight's angles stay inside its profile's safety envelope."""
    envelope, rates, volts = Envelope(flight.profile), (0.0, 0.0, 0.0), (0.0, 0.0)
    ends = (flight.angle.min(axis=0).tolist(), flight.angle.max(axis=0).tolist())
    return all(envelope.check(0.0, a, rates, volts, volts) is None for a in ends)


def _reference_recording(p: RenderedPlan) -> Recording:
    """Return an artificial recording with the references and extra voltages of the plan.

    `simulated_flight` reads these columns and the first angles. All angles are those of the rig at
    rest on the table, and all motor voltages are zero.
    """
    s = p.signals
    n = len(s.t)
    rest = np.tile(p.profile.encoder.rest_rad, (n, 1))
    return recording_of_arrays(
        s.t, np.zeros((n, 2)), rest, p.profile,
        reference=s.reference, voltage_extra=s.extra,
        channels={"phase": np.full(n, float(CLOSED_LOOP))},
    )  # fmt: skip


def flights_needed(certainty: Callable[[int], float]) -> int | None:
    """Return how many flights decide with at least the probability `LIKELY`.

    The result is None if not even `MOST_FLIGHTS` decide. ``certainty`` is a function that returns
    the probability of a decision after n flights.

    >>> flights_needed(lambda flights: flights / 3), flights_needed(lambda flights: 0.5)
    (3, None)
    """
    numbers = range(1, MOST_FLIGHTS + 1)
    return next((n for n in numbers if certainty(n) >= LIKELY), None)


def flights_sentence(flights: int | None) -> str:
    """Return a sentence: how many ``flights`` decide; None: not even `MOST_FLIGHTS`.

    >>> flights_sentence(3)
    '3 such flights decide with a probability of 90 %. Or measure one effect by hand'
    >>> flights_sentence(None)
    'Not even 20 such flights decide with a probability of 90 %: measure one effect by hand'
    """
    decide = f"such flights decide with a probability of {percent(LIKELY)}"
    if flights is None:
        return f"Not even {MOST_FLIGHTS} {decide}: measure one effect by hand"
    return f"{flights} {decide}. Or measure one effect by hand"
