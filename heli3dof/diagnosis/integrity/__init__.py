"""Integrity: is the recording what it says, before any physics is blamed?

Checks run in four stages, one small file each, found by being in this package (a module with
`CHECKS`): the *clock*, the *columns*' names, the *values*, the *motion*. A stage that finds the
recording unusable (`bad_data`) ends it: nothing that a broken clock says of the motion is worth
hearing.

Each `Fault` is of one kind:

``bad_data``          every later answer would be wrong: the diagnosis stops
``not_identifiable``  nothing is wrong, but nothing moves: there is nothing to diagnose
``finding``           a cause of the contract's list (``timing.gaps``, ``timing.jitter``, …) with
                      its size; the diagnosis goes on
``note``              odd but usable: said, no more
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterable
from functools import cache

from heli3dof.diagnosis.integrity.base import Check, Fault, Kind, Stage
from heli3dof.diagnosis.integrity.view import View
from heli3dof.recording.recording import Recording

__all__ = ["Check", "Fault", "Kind", "Stage", "checks", "integrity"]


@cache
def checks() -> tuple[Check, ...]:
    """Every check, by stage, then by name."""
    found: list[Check] = []
    for module in pkgutil.iter_modules(__path__):
        found += getattr(importlib.import_module(f"{__name__}.{module.name}"), "CHECKS", ())
    return tuple(sorted(found, key=lambda c: (c.stage, c.name)))


def integrity(recordings: Recording | Iterable[Recording]) -> tuple[Fault, ...]:
    """What is wrong with recordings as recordings: what stops the diagnosis stands first."""
    several = [recordings] if isinstance(recordings, Recording) else list(recordings)
    faults = [f for r in several for f in _of_one(r)]
    return tuple(sorted(faults, key=lambda f: Kind.ORDER.index(f.kind)))


def _of_one(recording: Recording) -> list[Fault]:
    view = View(recording)
    found: list[Fault] = []
    for stage in Stage:
        for check in checks():
            if check.stage is stage:
                found += check.run(view)
        if any(f.kind == Kind.BAD_DATA for f in found):
            break
    return found
