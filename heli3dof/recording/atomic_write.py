"""New files: complete or absent, and never over an existing file without ``force``."""

from __future__ import annotations

import contextlib
import errno
import os
import threading
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import BinaryIO

from heli3dof.errors import OutputExists, UsageError
from heli3dof.write_errors import ELSEWHERE, write_errors_explained

RECORDINGS = (".mcap", ".parquet")
"""Endings of files that heli3dof writes and no importer reads"""


def stem(path: Path) -> str:
    """The file's name without the ending of a recording or a log; other dots are part of it.

    >>> stem(Path("cable.yaw:0.1.mcap")), stem(Path("log.csv.gz"))
    ('cable.yaw:0.1', 'log')
    """
    from heli3dof.recording.logs.importers import endings

    name = path.name
    known = (*endings(), *RECORDINGS)
    return next((name[: -len(e)] for e in known if name.lower().endswith(e)), path.stem)


NAME_KEPT = 32
"""Characters of a name in its temporary file's name: 4 bytes each stay below 255 bytes"""
PROBE = b"\0" * 4096
"""Bytes written to test a folder: a block of most file systems"""


def check_outputs(
    *outputs: Path | None, force: bool, inputs: Iterable[Path] = (), fix: str = ELSEWHERE
) -> None:
    """Raise an error if an output cannot be created; call it before computing anything.

    OutputExists, UsageError (missing folder, no permission, the same name twice, or one of
    ``inputs``, which ``force`` does not overwrite either) or NoSpace. A file is written to every
    folder as a test. Outputs that are None are skipped.
    """
    read = [p for p in inputs if p.is_file()]
    seen: list[Path] = []
    for path in outputs:
        if path is None:
            continue
        check_output(path, force=force, fix=fix)
        if any(path.exists() and path.samefile(p) for p in read):
            raise UsageError(
                f"{path} is an input and cannot be the output as well.",
                cause="the output was given the name of an input.",
                fix="choose another name with -o",
            )
        if path.absolute() in seen:
            raise UsageError(
                f"Two outputs have the same name {path}.",
                cause="one name was given twice, or two recordings have the same name.",
                fix="give each output its own name",
            )
        seen.append(path.absolute())


def check_output(path: Path, *, force: bool, fix: str = ELSEWHERE) -> None:
    """Raise OutputExists, UsageError or NoSpace if ``path`` cannot be created."""
    _check_name(path, force=force)
    with write_errors_explained(path, fix=fix):
        place = path.resolve()
        if place.exists() and not place.is_file():  # a pipe or a device
            if not os.access(place, os.W_OK):
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        else:
            _probe(place.parent)


def check_folder(folder: Path, *, fix: str = ELSEWHERE) -> None:
    """Raise UsageError or NoSpace if no files can be written to ``folder``.

    A missing folder is judged by the nearest existing one above it, and not created.
    """
    with write_errors_explained(folder, fix=fix):
        there = folder.absolute()
        while not there.exists() and there != there.parent:
            there = there.parent
        _probe(there)


def new_folder(folder: Path, *, fix: str = ELSEWHERE) -> Path:
    """Create the folder and those above it; raises as `check_folder`."""
    with write_errors_explained(folder, fix=fix):
        folder.mkdir(parents=True, exist_ok=True)
    check_folder(folder, fix=fix)
    return folder


def _probe(folder: Path) -> None:
    """Write a file to the folder and remove it. Raises OSError."""
    probe = folder / f".{os.getpid()}-{threading.get_ident()}.part"
    try:
        with probe.open("xb", buffering=0) as stream:
            stream.write(PROBE)
    finally:
        with contextlib.suppress(OSError):
            probe.unlink(missing_ok=True)


def _check_name(path: Path, *, force: bool) -> None:
    """Raise OutputExists or UsageError for a name that cannot be used."""
    with write_errors_explained(path):
        there, folder = path.exists(), path.is_dir()
    if folder:
        raise UsageError(
            f"{path} is a folder, not a file.",
            cause="the file's name is missing after the folder.",
            fix=f"-o {path / 'recording.mcap'}",
        )
    if there and not force:
        raise OutputExists(
            f"{path} exists and was not overwritten.",
            cause="an earlier run wrote it.",
            fix=f"another name with -o, or --force to replace {path.name}",
        )
    if not path.parent.is_dir():
        raise UsageError(
            f"There is no folder {path.parent}.",
            cause="a typing error in the output's path, or the folder was not created yet.",
            fix=f"mkdir -p {path.parent}",
        )


def default_output(path: Path, *, force: bool) -> Path:
    """A default output's path: ``path`` itself with ``force``, else a name that is free."""
    return path if force else unused(path)


def unused(path: Path) -> Path:
    """``path``, or the first free numbered name: ``a-extended.json``, ``a-extended-2.json``, …

    For default names, so that an earlier run does not block the next one.
    """
    k, free = 1, path
    while free.exists():
        k += 1
        free = path.with_name(f"{path.stem}-{k}{path.suffix}")
    return free


def mode(path: Path, *, force: bool) -> str:
    """The mode to open ``path`` for writing: files also for reading, pipes and devices not.

    A pipe that the writer holds open for reading would not report that its reader has gone.
    """
    if not force:
        return "x+b"
    return "w+b" if path.is_file() or not path.exists() else "wb"


@contextlib.contextmanager
def new_file(path: str | Path, *, force: bool = False) -> Iterator[BinaryIO]:
    """A binary stream that becomes ``path`` when the block ends without an error.

    After an error nothing is left. A regular file's stream can also be read. Raises OutputExists,
    UsageError (missing folder, no permission) or NoSpace.
    """
    path = Path(path)
    check_output(path, force=force)
    path = path.resolve()  # a link stays a link; its target is replaced
    if path.exists() and not path.is_file():  # write to /dev/stdout, do not replace it
        with write_errors_explained(path), path.open("wb", buffering=0) as stream:
            yield stream
        return
    part = path.with_name(f".{path.name[:NAME_KEPT]}.{os.getpid()}.part")
    with write_errors_explained(path):
        try:
            with part.open("x+b", buffering=0) as stream:
                yield stream
                os.fsync(stream.fileno())
            if not force:
                _check_name(path, force=False)
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)


def write_file(path: str | Path, data: bytes, *, force: bool = False) -> Path:
    """Write a whole file at once, as `new_file` does, and return its path."""
    with new_file(path, force=force) as stream:
        left = memoryview(data)
        while left:
            left = left[stream.write(left) :]
    return Path(path)
