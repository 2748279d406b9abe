"""Make the reference recordings again: ``python -m heli3dof_recordings.make [name ...]``."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from heli3dof_recordings import FOLDER, Reference, references


def make(reference: Reference, folder: Path = FOLDER) -> Path:
    """Run one reference's command and return the file that it wrote in ``folder``."""
    from heli3dof.cli.app import app

    path = folder.resolve() / f"{reference.name}.mcap"
    before = Path.cwd()
    os.chdir(FOLDER)
    try:
        words = [*reference.command, "-o", str(path), "--force", "--quiet"]
        code = app(words, standalone_mode=False)
    finally:
        os.chdir(before)
    if code:
        sys.exit(f"{reference.name}: the command ended with exit code {code}")
    return path


def main(wanted: list[str]) -> None:
    for reference in references():
        if not wanted or reference.name in wanted:
            print(make(reference))


if __name__ == "__main__":
    main(sys.argv[1:])
