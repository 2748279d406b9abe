"""`Analysis`: what a verb does with one recording, and the columns that it adds to the table."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from heli3dof.integrity import Kind
from heli3dof.recording.info import read_with_info
from heli3dof.recording.load import load
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import Profile

Document = Mapping[str, Any]
Row = dict[str, Any]


@dataclass(frozen=True)
class Job:
    """The arguments of a verb for one recording: file on the worker's machine, options, profile."""

    path: Path | None
    """The recording's file; None in a sweep"""
    label: str
    """Name of the files that the verb writes"""
    folder: Path
    """Folder in which the verb writes; its files are then moved to the output folder"""
    options: Mapping[str, Any]
    profile: Profile | None

    @cached_property
    def recording(self) -> Recording:
        """Return the recording. Raises RecordingError or UsageError if it cannot be read."""
        return load(self.file, self.profile)

    @cached_property
    def intact(self) -> tuple[Recording, dict[str, Any]]:
        """Return the recording (of a torn file, its intact part) and facts about the file."""
        return read_with_info(self.file, self.profile)

    @property
    def file(self) -> Path:
        """Return the recording's file."""
        assert self.path is not None
        return self.path

    def output(self, kind: str, ending: str) -> Path:
        """Return the path of an output file with this ``ending``; create its subfolder ``kind``."""
        path = self.folder / kind / f"{self.label}{ending}"
        path.parent.mkdir(parents=True, exist_ok=True)
        return path


def whole_recording(job: Job) -> Recording:
    return job.recording


@dataclass(frozen=True)
class Analysis:
    """A verb that a batch runs on each recording: its function and its table columns."""

    name: str
    run: Callable[[Job], Document]
    """Function (job) → the verb's JSON document. It may raise Heli3dofError."""
    columns: Callable[[Document], Row]
    """Function (JSON document) → the verb's columns of the results table"""
    recording: Callable[[Job], Recording] = whole_recording
    """Function (job) → the recording that the first columns describe. For info and
    recover it is the intact part of a torn file."""


def bad_data(integrity: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return the names of the checks that found bad data.

    ``integrity``: the faults of a recording as in the JSON document of a diagnosis.
    """
    return [f["check"] for f in integrity if f["kind"] == Kind.BAD_DATA]


def with_std(parameters: Mapping[str, Mapping[str, Any]]) -> Row:
    """Return two columns for each parameter: its value, and its standard deviation ``NAME_std``."""
    row: Row = {}
    for name, p in parameters.items():
        row[name], row[f"{name}_std"] = p["value"], p["std"]
    return row
