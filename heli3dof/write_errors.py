"""Convert an OSError from writing a file into a heli3dof error with cause and fix.

==========================================  ===============  ===========
cause of the OSError                        error            exit code
==========================================  ===============  ===========
disk or quota full, file too large          `NoSpace`        5
not permitted, read-only                    `UsageError`     2
path cannot hold a file, I/O error          `UsageError`     2
==========================================  ===============  ===========
"""

from __future__ import annotations

import contextlib
import errno
from collections.abc import Iterator
from pathlib import Path

from heli3dof.errors import Heli3dofError, NoSpace, UsageError, quoted

FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
"""Error numbers: the disk or the quota is full, or the file is too large."""
_REFUSED = {errno.EACCES, errno.EPERM, errno.EROFS, errno.ETXTBSY}
_NO_PLACE = {
    errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.EEXIST, errno.ENAMETOOLONG, errno.ELOOP,
    errno.ENXIO, errno.EINVAL, errno.EIO, errno.ESTALE,
}  # fmt: skip
"""Error numbers: the path cannot hold a file, or the device fails."""
ELSEWHERE = "another place with -o"
"""What the error's message recommends: to write to another path, which ``-o`` sets"""


def refusal(path: Path, error: OSError, *, fix: str = ELSEWHERE) -> Heli3dofError | None:
    """Return a heli3dof error for an OSError from writing ``path``.

    The result is None if the table at the top of this module does not list the error's cause.
    ``fix``: what the error's message recommends.
    """
    if error.errno in FULL:
        return NoSpace(
            f"There is no space left for {path}.",
            cause="the disk or the quota is full.",
            fix=f"df -h {quoted(path.parent)}; free some space, or {fix}",
        )
    if error.errno in _REFUSED:
        return UsageError(
            f"{path} may not be written: {error.strerror}.",
            cause="the folder belongs to someone else or is read-only.",
            fix=fix,
        )
    if error.errno in _NO_PLACE:
        return UsageError(
            f"{path} cannot be written: {error.strerror}.",
            cause="the folder takes no new files (/proc, a lost network drive), the name is too "
            "long, or a part of the path is not a folder.",
            fix=fix,
        )
    return None


@contextlib.contextmanager
def write_errors_explained(path: Path, *, fix: str = ELSEWHERE) -> Iterator[None]:
    """Context manager: convert an OSError from writing ``path`` to a heli3dof error (`refusal`).

    ``fix``: what the error's message recommends. An OSError for which `refusal` has no conversion
    passes unchanged.
    """
    try:
        yield
    except OSError as error:
        ours = refusal(path, error, fix=fix)
        if ours is None:
            raise
        raise ours from error
