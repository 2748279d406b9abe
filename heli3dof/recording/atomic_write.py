"""Write output files: complete or not at all, and over an existing file only with ``force``."""

from __future__ import annotations

import contextlib
import errno
import itertools
import os
import re
import threading
from collections.abc import Iterable, Iterator
from io import RawIOBase
from pathlib import Path
from typing import BinaryIO

from heli3dof.errors import OutputExists, UsageError, quoted
from heli3dof.write_errors import ELSEWHERE, write_errors_explained

FORMATS = (".html", ".json", ".pdf", ".png", ".rrd", ".svg", ".toml", ".xml")
"""Endings of the formats that heli3dof writes, in addition to those of the importers"""


def stem(path: Path) -> str:
    """Return the file's name without the ending of a recording or a log; other dots are kept.

    >>> stem(Path("cable.yaw:0.1.mcap")), stem(Path("log.csv.gz"))
    ('cable.yaw:0.1', 'log')
    """
    from heli3dof.recording.logs.importers import endings

    name = path.name
    return next((name[: -len(e)] for e in endings() if name.lower().endswith(e)), path.stem)


def file_name(name: str) -> str:
    """Return ``name`` as a part of a file's name: separators and control characters become ``-``.

    Apply this function to a name from a file, such as a plan's, so that the name cannot lead to
    another folder.

    >>> file_name("../steps"), file_name("cable.yaw:0.1")
    ('..-steps', 'cable.yaw:0.1')
    """
    return re.sub(r"[/\\\x00-\x1f\x7f]", "-", name)


NAME_KEPT = 32
"""Number of a file name's first characters that the temporary file's name repeats. With at most 4
bytes each, they stay below the file systems' limit of 255 bytes."""
PROBE = b"\0" * 4096
"""Content of the test file that `_probe` writes: 4096 bytes, a block of most file systems"""


def check_outputs(*outputs: Path | None, force: bool, inputs: Iterable[Path] = ()) -> None:
    """Raise an error if an output file cannot be created. Call it before a long computation.

    * OutputExists: the file exists, and ``force`` is False
    * UsageError: the folder is missing or not writable, two outputs have the same name, or an
      output is one of ``inputs`` (an error even with ``force``)
    * NoSpace: the disk is full; a small file is written to every folder as a test

    Outputs that are None are skipped.
    """
    read = [p for p in inputs if p.is_file()]
    seen: list[Path] = []
    for path in outputs:
        if path is None:
            continue
        _check_name(path, force=force)
        with write_errors_explained(path):
            place = path.resolve()
            if place.exists() and not place.is_file():  # a pipe or a device
                if not os.access(place, os.W_OK):
                    raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
            else:
                _probe(place.parent)
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


def check_ending(path: Path, ending: str) -> None:
    """Raise UsageError if the name of a file in the format ``ending`` has another format's ending.

    heli3dof and other programs read a file by the ending of its name, so they could not read this
    one. Any other name is permitted.
    """
    from heli3dof.recording.logs.importers import endings

    others = {*endings(), *FORMATS} - {ending}
    wrong = next((e for e in others if path.name.lower().endswith(e)), None)
    if wrong is not None and not path.name.lower().endswith(ending):
        name = quoted(path.name[: -len(wrong)] + ending)
        raise UsageError(
            f"{path} would be a {ending} file, but its name ends in {wrong}.",
            cause="the output was given the name of a file of another format.",
            fix=f"the name {name}"
            if ending in (".html", ".toml")
            else f"-o {name}, then heli3dof export {name}; in Python the function export",
        )


def check_folder(folder: Path, *, fix: str = ELSEWHERE) -> None:
    """Raise UsageError or NoSpace if no files can be written to ``folder``.

    If the folder is missing, the nearest existing folder above it is tested instead; nothing is
    created. ``fix`` is the remedy that the error message names.
    """
    with write_errors_explained(folder, fix=fix):
        there = folder.absolute()
        while not there.exists() and there != there.parent:
            there = there.parent
        _probe(there)


def new_folder(folder: Path, *, fix: str = ELSEWHERE) -> Path:
    """Create ``folder`` with its missing parent folders, and return its path.

    ``fix`` is the remedy that an error message names. Raises UsageError or NoSpace if no files can
    be written to the folder.
    """
    with write_errors_explained(folder, fix=fix):
        folder.mkdir(parents=True, exist_ok=True)
    check_folder(folder, fix=fix)
    return folder


def _probe(folder: Path) -> None:
    probe = folder / f".{os.getpid()}-{threading.get_ident()}.part"
    try:
        with probe.open("xb", buffering=0) as stream:
            stream.write(PROBE)
    finally:
        with contextlib.suppress(OSError):
            probe.unlink(missing_ok=True)


def _check_name(path: Path, *, force: bool) -> None:
    with write_errors_explained(path):
        there, folder = path.exists(), path.is_dir()
    if folder:
        raise UsageError(
            f"{path} is a folder, not a file.",
            cause="the file's name is missing after the folder.",
            fix=f"-o {quoted(path / 'recording.mcap')}",
        )
    if there and not force:
        raise OutputExists(
            f"{path} exists and was not overwritten.",
            cause="an earlier run wrote it.",
            fix=f"another output, or force=True to replace {path.name}",
        )
    if not path.parent.is_dir():
        raise UsageError(
            f"There is no folder {path.parent}.",
            cause="a typing error in the output's path, or the folder was not created yet.",
            fix=f"mkdir -p {quoted(path.parent)}",
        )


def default_output(path: Path, *, force: bool, data: bytes | None = None) -> Path:
    """Return the path of an output for which ``-o`` is omitted; ``path`` is its default name.

    With ``force``, the result is ``path``, which the caller overwrites. Without, it is the first of
    ``a.json``, ``a-2.json``, … that does not exist, or that contains ``data``.
    """
    if force:
        return path
    return next(
        p for p in _numbered(path)
        if not p.exists() or (data is not None and p.is_file() and p.read_bytes() == data)
    )  # fmt: skip


@contextlib.contextmanager
def reserved(path: Path) -> Iterator[Path]:
    """Context manager: create the first of ``a.mcap``, ``a-2.mcap``, … that does not exist.

    Of several processes with the same ``path``, each gets its own name. The file is removed if it
    is still empty at the end.
    """
    for free in _numbered(path):
        with contextlib.suppress(FileExistsError):
            free.open("xb").close()
            break
    try:
        yield free
    finally:
        with contextlib.suppress(FileNotFoundError):  # somebody moved or deleted it
            if not free.stat().st_size:
                free.unlink()


def _numbered(path: Path) -> Iterator[Path]:
    """Yield ``a.json``, ``a-2.json``, ``a-3.json``, …"""
    yield path
    yield from (path.with_name(f"{path.stem}-{k}{path.suffix}") for k in itertools.count(2))


def mode(path: Path, *, force: bool) -> str:
    """Return the mode with which ``open`` must open ``path``; ``force`` permits overwriting.

    Files are opened for writing and reading, existing pipes and devices for writing only. A writer
    that also opened a pipe for reading would not notice that the pipe's reader has ended.
    """
    if not force:
        return "x+b"
    return "w+b" if path.is_file() or not path.exists() else "wb"


@contextlib.contextmanager
def new_file(path: str | Path, *, force: bool = False) -> Iterator[BinaryIO]:
    """Context manager: yield a binary stream whose content becomes the file ``path`` at the end.

    If the block raises, the file is not created or replaced. The stream can also be read, except
    for a pipe or device, which is written directly. Raises OutputExists, UsageError (missing
    folder, no permission) or NoSpace.
    """
    path = Path(path)
    check_outputs(path, force=force)
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
    """Write ``data`` to a new file, completely or not at all; return the path. See `new_file`."""
    with new_file(path, force=force) as stream:
        write_all(stream, data)
    return Path(path)


def write_all(stream: RawIOBase | BinaryIO, data: bytes | memoryview) -> None:
    """Write all of ``data`` to an unbuffered stream, which may take a part of it at a time."""
    left = memoryview(data)
    while left:
        left = left[stream.write(left) or 0 :]
