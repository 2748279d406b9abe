"""Seeing a file onto the disk while it is still being written.

What a program has written survives its death, but not the machine's: the system keeps it in
memory for up to half a minute. A thread of its own asks for it to be put on the disk, again and
again, as soon as there is something new. A slow disk holds up this thread only, neither the
recorder nor (the call runs without the interpreter's lock) the loop.
"""

from __future__ import annotations

import errno
import os
import threading

SYNC_S = 0.15
"""s at least between the end of one and the start of the next"""
NO_DISK = {errno.EINVAL, errno.ENOSYS, errno.ENOTSUP}
"""What pipes and some network file systems say: there is nothing to be synced."""

_sync = getattr(os, "fdatasync", os.fsync)  # macOS has only the latter


class Syncer:
    """Keeps an open file's data on the disk; `failure` holds what went wrong."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._news = threading.Event()
        self._closing = threading.Event()
        self.failure: OSError | None = None
        self._thread = threading.Thread(target=self._run, name="sync", daemon=True)
        self._thread.start()

    def written(self) -> None:
        """There is something new in the file."""
        self._news.set()

    def close(self) -> None:
        """Leave the file alone from now on. Idempotent."""
        self._closing.set()
        self._news.set()
        self._thread.join()

    def _run(self) -> None:
        while True:
            self._news.wait()
            if self._closing.is_set():
                return
            self._news.clear()
            try:
                _sync(self._descriptor)
            except OSError as error:
                if error.errno not in NO_DISK:
                    self.failure = error
                return
            self._closing.wait(SYNC_S)
