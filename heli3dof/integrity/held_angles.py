"""Report angles that the log holds for several rows (`heli3dof.recording.logs.held_angles`)."""

from __future__ import annotations

from collections.abc import Iterable

from heli3dof.integrity.base import Check, Fault, Kind, Stage
from heli3dof.integrity.clock import repeated
from heli3dof.integrity.remedies import is_log
from heli3dof.integrity.view import View
from heli3dof.recording.logs.held_angles import HELD_CAUSE, held_clause, held_fix


def held(view: View) -> Iterable[Fault]:
    """Yield a fault if angles are held, unless whole rows are repeated."""
    r, axes = view.recording, view.held_axes
    if not axes or any(repeated(view)):
        return
    rate_hz = 1 / view.ticks.period_s
    slowest_hz = rate_hz / max(axes.values())
    yield Fault(
        "clock.held", Kind.BAD_DATA, r.name,
        f"{r.name}: {held_clause(axes, rate_hz)}.", HELD_CAUSE,
        held_fix(axes, rate_hz) if is_log(r) else
        f"record with loop.rate_hz = {slowest_hz:.3g} in the profile, or read every encoder in "
        "each row",
        axis=next(iter(axes)) if len(axes) == 1 else None, confidence=0.99,
    )  # fmt: skip


CHECKS = (Check("clock.held", Stage.CLOCK, "angles held for several rows", held),)
