"""New files: never over an existing one without force, never half written under the final name."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from heli3dof.errors import NoSpace, OutputExists, UsageError

FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
"""What the system answers when nothing more fits: disk, quota, largest file."""


NO_PLACE = {
    errno.ENOENT, errno.ENOTDIR, errno.EEXIST, errno.ENAMETOOLONG, errno.ELOOP, errno.ENXIO,
    errno.EINVAL, errno.EIO, errno.ESTALE,
}  # fmt: skip
"""What it answers where a file cannot be at all."""

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


def check_output(path: Path, *, force: bool) -> None:
    """Raise OutputExists or UsageError where ``path`` cannot be created."""
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
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    with explained(path):
        try:
            with part.open("x+b", buffering=0) as stream:
                yield stream
                os.fsync(stream.fileno())
            if not force:
                check_output(path, force=False)
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


@contextlib.contextmanager
def explained(path: Path) -> Iterator[None]:
    """Turn the system's errors about ``path`` into ours."""
    try:
        yield
    except OSError as error:
        if error.errno in FULL:
            raise NoSpace(
                f"There is no space left for {path}.",
                cause="the disk or the quota is full.",
                fix=f"df -h {path.parent}; free some space, or write elsewhere with -o",
            ) from error
        if error.errno in {errno.EACCES, errno.EPERM, errno.EROFS}:
            raise UsageError(
                f"{path} may not be written: {error.strerror}.",
                cause="the folder belongs to someone else or is read-only.",
                fix="another place with -o",
            ) from error
        if error.errno in NO_PLACE:
            raise UsageError(
                f"{path} cannot be written: {error.strerror}.",
                cause="the folder takes no new files, as /proc does and a network drive that has "
                "gone; or the name is too long, or a part of the path is no folder.",
                fix="another place with -o",
            ) from error
        raise
