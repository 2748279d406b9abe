"""The first part of a plan, flown: the same rows as of the whole flight, at a part of its cost."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import Plan, Signals, load_plan
from heli3dof.recording.recording import Recording


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


def flown(plan: Plan | str, until_s: float, **options: Any) -> Recording:
    """Return ``fly_plan(plan, **options).recording.between(0.0, until_s)``.

    A rich flight costs 0.03 s of CPU time per second; its rest is not flown.
    """
    return fly_plan(first_part(plan, until_s), **options).recording.between(0.0, until_s)
