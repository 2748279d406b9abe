"""What a check says and what it is."""

from __future__ import annotations

import enum
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from heli3dof.errors import RecordingError

if TYPE_CHECKING:
    from heli3dof.diagnosis.integrity.view import View


class Kind:
    """What a fault means for the diagnosis; see the package."""

    BAD_DATA = "bad_data"
    NOT_IDENTIFIABLE = "not_identifiable"
    FINDING = "finding"
    NOTE = "note"
    ORDER = (BAD_DATA, NOT_IDENTIFIABLE, FINDING, NOTE)


class Stage(enum.IntEnum):
    """A later stage runs only where the earlier ones found no bad data."""

    CLOCK = 0
    COLUMNS = 1
    VALUES = 2
    MOTION = 3


@dataclass(frozen=True)
class Fault:
    """One thing that is wrong with one recording."""

    check: str
    """Name of the check, ``encoder.frozen``"""
    kind: str
    """One of `Kind`"""
    recording: str
    sentence: str
    """What happened, with numbers"""
    cause: str
    fix: str
    """What to do: a command where there is one"""
    effect: str | None = None
    """Name in the contract's list of effects, where there is one"""
    axis: str | None = None
    parameters: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Parameter → (value, standard deviation), units in the names"""
    confidence: float = 1.0

    def to_dict(self) -> dict[str, Any]:
        """JSON-able."""
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
    """``run(view)`` gives the faults of one recording; ``tells`` is a line for people."""

    name: str
    stage: Stage
    tells: str
    run: Callable[[View], Iterable[Fault]]


def refused(check: str, view: View, error: RecordingError, axis: str | None = None) -> Fault:
    """The bad data that an importing check raises an error for, as a fault."""
    return Fault(
        check, Kind.BAD_DATA, view.recording.name, error.what, error.cause, error.fix, axis=axis
    )
