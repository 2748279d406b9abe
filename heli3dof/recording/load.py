"""`load`: reads a recording from any kind of file that heli3dof accepts."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from heli3dof.recording.logs.import_log import import_log
from heli3dof.recording.logs.importers import importer_of
from heli3dof.recording.mcap_files.reader import read_recording
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import Profile


def load(
    path: str | Path,
    profile: Profile | None = None,
    columns: str | Sequence[str] | None = None,
) -> Recording:
    """Read a `Recording` from an MCAP file or from a log (`importers`): CSV, MAT, …

    A log needs the argument ``profile``. A recording of heli3dof contains a profile, which the
    argument replaces. ``columns`` names the rows or columns of a matrix in a MAT file. Raises
    RecordingError (the command then exits with status 5) or UsageError (status 2).
    """
    if importer_of(path) is not None:
        return import_log(path, profile, columns)
    return read_recording(path, profile)
