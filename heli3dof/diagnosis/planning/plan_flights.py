"""Plans flown in worlds that might be the true one, quickly: what a forecast is made of.

A plan is rendered and checked once, whatever it is flown in; a world's loop is checked once,
whatever is flown in it. A flight is then one compiled pass with the world's noise and encoders
(`estimate.simulated_flight`). Only where a plan opens loops is it flown without noise
before: what such a plan asks for follows from how it goes (`heli3dof.model.control.loop_opening`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from heli3dof.diagnosis.estimate.simulated_flight import simulated_flight
from heli3dof.errors import CheckFailed, UsageError
from heli3dof.experiment.plan import Plan, Signals, check_plan
from heli3dof.experiment.simulate import simulate
from heli3dof.model.control.stability import check_loop
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.recording.recording import Recording, make_recording
from heli3dof.recording.row import CLOSED_LOOP
from heli3dof.rig.envelope import Envelope
from heli3dof.rig.profile import Profile


@dataclass(frozen=True, eq=False)
class Task:
    """A plan rendered for a rig: the same for every world it is flown in."""

    plan: Plan
    signals: Signals
    profile: Profile
    seed: int


def task_of(plan: Plan, profile: Profile, seed: int) -> Task | None:
    """The plan rendered, its loop known; None where it would leave the envelope by itself."""
    profile = profile.with_controller()
    try:
        signals = plan.render(profile.dt, seed)
        check_plan(plan, signals, profile)
    except (UsageError, CheckFailed):
        return None
    return Task(plan, signals, profile, seed)


def stable(world: GreyBoxModel, profile: Profile) -> bool:
    """True where the profile's gain stabilises that world."""
    controller = profile.with_controller().controller
    assert controller is not None
    try:
        check_loop(world, controller, profile.dt)
    except (UsageError, CheckFailed):
        return False
    return True


def fly_task(task: Task, world: GreyBoxModel) -> Recording | None:
    """Flown in a `stable` world with its noise; None where it leaves the envelope."""
    if task.signals.opened is None:
        asked = _asked(task)
    else:
        try:
            asked = simulate(task.plan, world, profile=task.profile, seed=task.seed)
        except (UsageError, CheckFailed):
            return None
    flight = simulated_flight(world, asked, np.random.default_rng([task.seed, 5]))
    return flight if inside(flight) else None


def inside(flight: Recording) -> bool:
    """True where the flight's angles stay in its profile's envelope."""
    envelope, still, volts = Envelope(flight.profile), (0.0, 0.0, 0.0), (0.0, 0.0)
    ends = (flight.angle.min(axis=0).tolist(), flight.angle.max(axis=0).tolist())
    return all(envelope.check(0.0, a, still, volts, volts) is None for a in ends)


def _asked(task: Task) -> Recording:
    """A recording that holds what the plan asks for, and where it starts: at rest on the table."""
    s = task.signals
    n = len(s.t)
    rest = np.tile(task.profile.encoder.rest_rad, (n, 1))
    return make_recording(
        s.t, np.zeros((n, 2)), rest, task.profile,
        reference=s.reference, voltage_extra=s.extra,
        channels={"phase": np.full(n, float(CLOSED_LOOP))},
    )  # fmt: skip
