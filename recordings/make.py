"""Make the reference recordings again: ``python -m heli3dof_recordings.make [name ...]``."""

from __future__ import annotations

import os
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

from heli3dof_recordings import FOLDER, Reference, references


def make(reference: Reference, folder: Path = FOLDER) -> Path:
    """Run a reference recording's command and write its file to ``folder``; return the path.

    The file omits the host, the Git state and the paths of this computer, because it is published.
    """
    from heli3dof.cli.app import app
    from heli3dof.recording.mcap_files.reader import read_recording
    from heli3dof.recording.write import write_recording

    path = folder.resolve() / f"{reference.name}.mcap"
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as scratch:
        flown = Path(scratch) / path.name
        os.chdir(FOLDER)
        try:
            code = app([*reference.command, "-o", str(flown), "--quiet"], standalone_mode=False)
        finally:
            os.chdir(before)
        if code:
            sys.exit(f"{reference.name}: the command ended with exit code {code}")
        recording = read_recording(flown)
    meta = {k: v for k, v in recording.meta.items() if k not in ("host", "git", "command_line")}
    meta["command_line"] = ["heli3dof", *reference.command]
    return write_recording(replace(recording, meta=meta), path, force=True)


def main(wanted: list[str]) -> None:
    for reference in references():
        if not wanted or reference.name in wanted:
            print(make(reference))


if __name__ == "__main__":
    main(sys.argv[1:])
