"""Flights for tests: the first part of a plan, without safety monitors.

A rich flight costs 0.02 s of CPU time per second; its rest and its ramp to zero are not flown.
Safety monitors change no row of a flight that they do not end, and would add 0.013 s.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any
from unittest.mock import patch

from heli3dof.experiment.control_loop.ramp_down import RampDown
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import Plan, Signals, load_plan
from heli3dof.recording.recording import Recording

RAMP = "heli3dof.experiment.control_loop.loop.ramp_to_zero"


@dataclass(frozen=True)
class FirstPart(Plan):
    """A plan whose signals end after ``until_s``; those before are the whole plan's."""

    until_s: float = 0.0

    def render(self, dt: float, seed: int) -> Signals:
        signals = super().render(dt, seed)
        rows = slice(0, round(self.until_s / dt) + 2)
        return replace(
            signals,
            t=signals.t[rows],
            reference=signals.reference[rows],
            extra=signals.extra[rows],
            opened=None if signals.opened is None else signals.opened[rows],
        )


def first_part(plan: Plan | str, until_s: float) -> FirstPart:
    """Return the first ``until_s`` seconds of a plan; a flight of it lands from there."""
    whole = load_plan(plan) if isinstance(plan, str) else plan
    return FirstPart(whole.name, whole.segments, whole.description, whole.purpose, until_s)


def flown(plan: Plan | str, until_s: float | None = None, **options: Any) -> Recording:
    """Return the rows of ``fly_plan(plan, **options)`` until ``until_s``; None: all rows."""
    whole = load_plan(plan) if isinstance(plan, str) else plan
    with patch("heli3dof.experiment.fly.monitors_for", lambda profile: ()):
        if until_s is None:
            flight = fly_plan(whole, **options)
        else:
            with patch(RAMP, lambda *args, **keys: RampDown(True)):
                flight = fly_plan(first_part(whole, until_s), **options)
    flight.raise_if_cut_short()
    return flight.recording if until_s is None else flight.recording.between(0.0, until_s)
