"""`Analysis`: what a verb does with one recording, and the columns that it adds to the table."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from heli3dof.recording.load import load
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import Profile

Document = Mapping[str, Any]
Row = dict[str, Any]


@dataclass(frozen=True)
class Job:
    """What a verb needs for one recording, on the worker's machine."""

    path: Path | None
    """The recording's file; None in a sweep"""
    label: str
    """Name of the files that the verb writes"""
    folder: Path
    """The verb writes here; the files are then moved to the output folder"""
    options: Mapping[str, Any]
    profile: Profile | None

    @cached_property
    def recording(self) -> Recording:
        """Return the recording. Raises RecordingError or UsageError if it cannot be read."""
        return load(self.file, self.profile)

    @property
    def file(self) -> Path:
        """Return the recording's file."""
        assert self.path is not None
        return self.path

    def output(self, kind: str, ending: str) -> Path:
        """Return the path for a file of a kind such as "models", and create its folder."""
        path = self.folder / kind / f"{self.label}{ending}"
        path.parent.mkdir(parents=True, exist_ok=True)
        return path


def whole_recording(job: Job) -> Recording:
    return job.recording


@dataclass(frozen=True)
class Analysis:
    """A verb of a batch."""

    name: str
    run: Callable[[Job], Document]
    """Return the verb's JSON document. Raises Heli3dofError"""
    columns: Callable[[Document], Row]
    """Return the columns of the results table that follow from the document"""
    recording: Callable[[Job], Recording] = field(default=whole_recording)
    """Return the recording for the first columns; info and recover also read torn ones"""
    memory_MB: int = 1000
    """Memory of one task, which a cluster reserves: measured for a minute of flight, rounded up"""


def with_std(parameters: Mapping[str, Mapping[str, Any]]) -> Row:
    """Return two columns for each parameter: its value, and its standard deviation ``NAME_std``."""
    row: Row = {}
    for name, p in parameters.items():
        row[name], row[f"{name}_std"] = p["value"], p["std"]
    return row
