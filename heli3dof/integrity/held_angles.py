"""Report an angle if the log repeats each of its encoder readings in several successive rows.

`heli3dof.recording.logs.held_angles` finds these angles.
"""

from __future__ import annotations

from collections.abc import Iterable

from heli3dof.integrity.base import Check, Fault, Kind, Stage
from heli3dof.integrity.clock import repeated
from heli3dof.integrity.remedies import is_log
from heli3dof.integrity.view import View
from heli3dof.recording.logs.held_angles import HELD_CAUSE, held_angles_clause, one_row_per_reading


def held(view: View) -> Iterable[Fault]:
    """Yield a fault if the log repeats each encoder reading of an angle in several successive rows.

    If the log repeats whole rows, `repeated` reports this, and the function yields nothing.
    """
    r, axes = view.recording, view.held_axes
    if not axes or any(repeated(view)):
        return
    rate_hz = 1 / view.sampling_clock.period_s
    slowest_hz = rate_hz / max(axes.values())
    yield Fault(
        "clock.held", Kind.BAD_DATA, r.name,
        f"{r.name}: {held_angles_clause(axes, rate_hz)}.", HELD_CAUSE,
        one_row_per_reading(axes, rate_hz) if is_log(r) else
        f"record with loop.rate_hz = {slowest_hz:.3g} in the profile, or read every encoder in "
        "each row",
        axis=next(iter(axes)) if len(axes) == 1 else None, confidence=0.99,
    )  # fmt: skip


CHECKS = (Check("clock.held", Stage.CLOCK, "angles held for several rows", held),)
