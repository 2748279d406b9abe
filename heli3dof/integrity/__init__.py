"""Check recordings for faults of clock, columns, values and motion before they are diagnosed.

Each module of this package with a tuple `CHECKS` adds checks. They run in five stages (`Stage`), in
this order: clock, columns, values, motion, controller. A stage that finds bad data is the last one
to run. A check reports each fault as a `Fault` of one kind:

``bad_data``          all later results would be wrong: the diagnosis stops
``not_identifiable``  the recording contains no motion to diagnose
``finding``           an effect of docs/reference/effects.md (``timing.gaps``, …) with its size, or
                      another controller than the profile's; the diagnosis continues
``note``              unusual but usable
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache

from heli3dof.errors import Heli3dofError
from heli3dof.integrity.base import Check, Fault, Kind, Stage
from heli3dof.integrity.view import View
from heli3dof.plugins import modules_of
from heli3dof.recording.logs.corrections import limited
from heli3dof.recording.recording import Recording

__all__ = ["Check", "Fault", "Kind", "Stage", "checks", "integrity"]

HELPERS = ("base", "remedies", "response", "view")
"""Files of this folder without checks"""


@cache
def checks() -> tuple[Check, ...]:
    """Return all checks, ordered by stage, then by name.

    Raises Heli3dofError if a file of this folder states none and is not one of the `HELPERS`.
    """
    result: list[Check] = []
    for module in modules_of(__name__):
        if module.__name__.rpartition(".")[2] in HELPERS:
            continue
        stated = getattr(module, "CHECKS", None)
        if not (isinstance(stated, tuple) and all(isinstance(c, Check) for c in stated)):
            raise Heli3dofError(
                f"{module.__name__.replace('.', '/')}.py states no checks that can run.",
                cause="CHECKS is missing, misspelt, or not a tuple of Check.",
                fix="correct it, or name a file without checks in HELPERS of "
                "heli3dof/integrity/__init__.py",
            )
        result += stated
    return tuple(sorted(result, key=lambda c: (c.stage, c.name)))


def integrity(recordings: Recording | Iterable[Recording]) -> tuple[Fault, ...]:
    """Return the faults of the recordings, ordered by kind; ``bad_data`` comes first."""
    several = [recordings] if isinstance(recordings, Recording) else list(recordings)
    faults = [f for r in several for f in _of_one(r)]
    return tuple(sorted(faults, key=lambda f: Kind.ORDER.index(f.kind)))


def _of_one(recording: Recording) -> list[Fault]:
    view = View(recording)
    faults: list[Fault] = []
    for stage in Stage:
        if stage is Stage.MOTION and (flown := limited(view.recording)) is not view.recording:
            # The checks found no sign that voltages beyond the limit reached the motors.
            view = View(flown)
        for check in checks():
            if check.stage is stage:
                faults += check.run(view)
        if any(f.kind == Kind.BAD_DATA for f in faults):
            break
    return faults
