"""Define the classes `Check` and `Fault`, the stages of checks and the kinds of faults."""

from __future__ import annotations

import enum
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from heli3dof.errors import RecordingError

if TYPE_CHECKING:
    from heli3dof.integrity.view import View


class Kind:
    """Names of the kinds of faults (`heli3dof.integrity`); in `ORDER`, the most severe is first."""

    BAD_DATA = "bad_data"
    NOT_IDENTIFIABLE = "not_identifiable"
    FINDING = "finding"
    NOTE = "note"
    ORDER = (BAD_DATA, NOT_IDENTIFIABLE, FINDING, NOTE)


class Stage(enum.IntEnum):
    """Stages of the checks. A stage runs only if no earlier stage found bad data."""

    CLOCK = 0
    COLUMNS = 1
    VALUES = 2
    MOTION = 3
    CONTROLLER = 4


@dataclass(frozen=True)
class Fault:
    """A fault of one recording: what happened, the likely cause, and the fix."""

    check: str
    """Name of the fault, such as ``encoder.frozen``; `Check.faults` lists those of a check"""
    kind: str
    """One of `Kind`"""
    recording: str
    sentence: str
    """What happened, with numbers and limits"""
    cause: str
    fix: str
    """Command or change that removes the fault; empty if there is nothing to do"""
    effect: str | None = None
    """Name of the effect in docs/reference/effects.md that the fault is, or None"""
    axis: str | None = None
    parameters: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Parameter → (value, standard deviation); the unit is part of the parameter's name"""
    confidence: float = 1.0
    """From 0 to 1; chosen, not computed"""
    allowed_for: bool = False
    """True if a simulation of the recording includes the fault, such as lost samples, or sampling
    jitter that the time stamps show. The fault then causes no simulation error."""

    @property
    def is_cause(self) -> bool:
        """Return True if the fault is a finding (`Kind`) that names an effect."""
        return self.kind == Kind.FINDING and self.effect is not None

    def to_dict(self) -> dict[str, Any]:
        """Return the fault as an object of the JSON document."""
        return {
            "check": self.check,
            "kind": self.kind,
            "recording": self.recording,
            "effect": self.effect,
            "axis": self.axis,
            "parameters": {n: {"value": v, "std": s} for n, (v, s) in self.parameters.items()},
            "confidence": self.confidence,
            "sentence": self.sentence,
            "cause": self.cause,
            "fix": self.fix,
        }


@dataclass(frozen=True)
class Check:
    """A check of a recording."""

    name: str
    stage: Stage
    reports: str
    """What the check searches for, in a few words"""
    run: Callable[[View], Iterable[Fault]]
    """Returns the faults that the check finds in a recording's `View`"""
    faults: tuple[str, ...] = ()
    """Names of its faults (`Fault.check`); empty if all have the check's name"""


def bad_data_fault(check: str, view: View, error: RecordingError, axis: str | None = None) -> Fault:
    """Return the ``error`` raised by a check of imported logs, as a fault of kind ``bad_data``."""
    return Fault(
        check, Kind.BAD_DATA, view.recording.name, error.what, error.cause, error.fix, axis=axis
    )
