"""`load`: what every verb does with the files it is given."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from heli3dof.errors import UsageError
from heli3dof.recording.atomic_write import stem
from heli3dof.recording.logs.import_log import import_log, is_log
from heli3dof.recording.mcap_files.mcap_scan import missing
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import Profile


def load(
    path: str | Path,
    profile: Profile | None = None,
    columns: str | Sequence[str] | None = None,
) -> Recording:
    """A `Recording` from an MCAP file or from a log (``.csv``, ``.csv.gz``, ``.mat``).

    A log carries no profile and needs one; an MCAP file of ours carries its own, which
    ``profile`` replaces. Raises RecordingError (5), UsageError (2).
    """
    path = Path(path)
    if is_log(path):
        if not path.exists():
            raise missing(path)
        if profile is None:
            raise UsageError(
                f"{path} is a log, and a log does not say which rig it is from.",
                cause="no profile was named.",
                fix=f"add --profile PROFILE.toml, or once and for all: heli3dof import {path} "
                f"--profile PROFILE.toml -o {stem(path)}.mcap",
            )
        return import_log(path, profile, columns)
    from heli3dof.recording.mcap_files.reader import read_recording

    return read_recording(path, profile)
