"""New files: never over an existing one without force, never half written under the final name."""

from __future__ import annotations

import contextlib
import errno
import os
import threading
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import BinaryIO

from heli3dof.errors import OutputExists, UsageError
from heli3dof.write_errors import ELSEWHERE, explained

LOGS = (".csv.gz", ".csv", ".mat")
"""What a log of another program may end in."""
ENDINGS = (*LOGS, ".mcap", ".parquet")


def stem(path: Path) -> str:
    """The file's name without the ending of a recording or a log; other dots are part of it.

    >>> stem(Path("cable.yaw:0.1.mcap")), stem(Path("log.csv.gz"))
    ('cable.yaw:0.1', 'log')
    """
    name = path.name
    return next((name[: -len(e)] for e in ENDINGS if name.lower().endswith(e)), path.stem)


NAME_KEPT = 32
"""Characters of a name in the name of its part: four bytes each leave room below 255"""
PROBE = b"\0" * 4096
"""What is written to learn that a folder takes files: a block of most file systems"""


def check_outputs(
    *outputs: Path | None, force: bool, inputs: Iterable[Path] = (), fix: str = ELSEWHERE
) -> None:
    """Raise where one of the files cannot be created, before anything is computed for them.

    OutputExists, UsageError (no such folder, not permitted, named twice, or one of ``inputs``,
    which even ``force`` does not overwrite) or NoSpace. Every folder is tried with a real file.
    None stands for an output that was not asked for.
    """
    read = [p for p in inputs if p.is_file()]
    seen: list[Path] = []
    for path in outputs:
        if path is None:
            continue
        check_output(path, force=force, fix=fix)
        if any(path.exists() and path.samefile(p) for p in read):
            raise UsageError(
                f"{path} is read and cannot be written at the same time.",
                cause="the output has the name of an input.",
                fix="another name with -o",
            )
        if path.absolute() in seen:
            raise UsageError(
                f"Two files would be written to {path}.",
                cause="two outputs were given one name, or two recordings have the same name.",
                fix="give each a name of its own",
            )
        seen.append(path.absolute())


def check_output(path: Path, *, force: bool, fix: str = ELSEWHERE) -> None:
    """Raise OutputExists, UsageError or NoSpace where ``path`` cannot be created."""
    _check_name(path, force=force)
    with explained(path, fix=fix):
        place = path.resolve()
        if place.exists() and not place.is_file():  # a pipe or a device
            if not os.access(place, os.W_OK):
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        else:
            _probe(place.parent)


def check_folder(folder: Path, *, fix: str = ELSEWHERE) -> None:
    """Raise UsageError or NoSpace where ``folder`` is none that files can be written to.

    It need not exist yet; nothing is made.
    """
    with explained(folder, fix=fix):
        there = folder.absolute()
        while not there.exists() and there != there.parent:
            there = there.parent
        _probe(there)


def new_folder(folder: Path, *, fix: str = ELSEWHERE) -> Path:
    """Make the folder where it is missing, and every one above it; raises as `check_folder`."""
    with explained(folder, fix=fix):
        folder.mkdir(parents=True, exist_ok=True)
    check_folder(folder, fix=fix)
    return folder


def _probe(folder: Path) -> None:
    """Write a file in the folder, and remove it. Raises OSError."""
    probe = folder / f".{os.getpid()}-{threading.get_ident()}.part"
    try:
        with probe.open("xb", buffering=0) as stream:
            stream.write(PROBE)
    finally:
        with contextlib.suppress(OSError):
            probe.unlink(missing_ok=True)


def _check_name(path: Path, *, force: bool) -> None:
    """Raise OutputExists or UsageError where the name itself cannot be taken."""
    with explained(path):
        there, folder = path.exists(), path.is_dir()
    if folder:
        raise UsageError(
            f"{path} is a folder, not a file.",
            cause="the file's name is missing after the folder.",
            fix=f"-o {path / 'recording.mcap'}",
        )
    if there and not force:
        raise OutputExists(
            f"{path} exists and was left as it is.",
            cause="an earlier run wrote it; heli3dof never overwrites unasked.",
            fix=f"another name with -o, or --force to replace {path.name}",
        )
    if not path.parent.is_dir():
        raise UsageError(
            f"There is no folder {path.parent}.",
            cause="a typing error in the output's path, or a folder not made yet.",
            fix=f"mkdir -p {path.parent}",
        )


def ours(path: Path, *, force: bool) -> Path:
    """Where to write what nobody named: ``path``, and beside what is there without ``force``."""
    return path if force else unused(path)


def unused(path: Path) -> Path:
    """A name of our own making: ``path``, or its first numbered neighbour that is free.

    ``a-extended.json``, ``a-extended-2.json``, … Where nobody asked for a name, an earlier run is
    no reason to refuse the next one.
    """
    k, free = 1, path
    while free.exists():
        k += 1
        free = path.with_name(f"{path.stem}-{k}{path.suffix}")
    return free


def mode(path: Path, *, force: bool) -> str:
    """How to open ``path`` for writing: a file so that it can be read, too, a pipe or device not.

    A pipe that its writer could read as well would never tell it that the reader has gone.
    """
    if not force:
        return "x+b"
    return "w+b" if path.is_file() or not path.exists() else "wb"


@contextlib.contextmanager
def new_file(path: str | Path, *, force: bool = False) -> Iterator[BinaryIO]:
    """A binary stream that becomes ``path`` when the block ends well, and vanishes when not.

    A file's can be read back.

    Raises OutputExists, UsageError (no such folder, not permitted) or NoSpace.
    """
    path = Path(path)
    check_output(path, force=force)
    path = path.resolve()  # a link stays a link; what it names is replaced
    if path.exists() and not path.is_file():  # /dev/stdout and its like are written, not replaced
        with explained(path), path.open("wb", buffering=0) as stream:
            yield stream
        return
    part = path.with_name(f".{path.name[:NAME_KEPT]}.{os.getpid()}.part")
    with explained(path):
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
