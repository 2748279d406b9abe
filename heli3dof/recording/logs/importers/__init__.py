"""Find the importers of log formats: every module of this folder has one.

The module defines ``IMPORTER``, an `Importer`: ``sniff`` recognises a file, ``read`` returns its
columns as a `Table`. Checks, units and provenance are common to all formats
(`heli3dof.recording.logs.import_log`). Another package adds a format through the entry point group
``heli3dof.importers``::

    [project.entry-points."heli3dof.importers"]
    tdms = "my_package.tdms:IMPORTER"
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

from heli3dof.plugins import modules_of, must_be, use_plugins
from heli3dof.recording.logs.importer import Importer

GROUP = "heli3dof.importers"


@cache
def importers() -> tuple[Importer, ...]:
    """Return the importers of all log formats, in the order in which they examine a file.

    Those of other packages are last, or first if they have ``recognises``: it can distinguish a
    dialect of a format that heli3dof reads, such as CSV. An importer that cannot be loaded is
    omitted with a warning.
    """
    found: list[Importer] = [module.IMPORTER for module in modules_of(__name__)]

    def add(importer: Importer) -> None:
        must_be(Importer, importer)
        found.insert(0 if importer.recognises else len(found), importer)

    use_plugins(GROUP, "importer", add)
    return tuple(found)


def importer_of(path: str | Path) -> Importer | None:
    """Return the first importer that recognises the file, or None.

    No importer recognises heli3dof's own recordings.
    """
    return next((i for i in importers() if i.sniff(Path(path))), None)


def endings() -> tuple[str, ...]:
    """Return the endings of the names of importable files, longest first."""
    return tuple(sorted({e for i in importers() for e in i.endings}, key=len, reverse=True))
