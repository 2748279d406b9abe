"""`Syncer`: makes the operating system write a file's new data to the disk during a flight.

Written data survive the end of the process, but not a power cut: the system keeps them in memory
for up to half a minute. A separate thread therefore calls fdatasync whenever there are new data. A
slow disk delays this thread, but neither the recorder nor the control loop, since the call releases
the interpreter's lock.
"""

from __future__ import annotations

import errno
import os
import threading

SYNC_S = 0.15
"""s, minimum pause between two calls of fdatasync"""
NO_DISK = {errno.EINVAL, errno.ENOSYS, errno.ENOTSUP}
"""Errors of fdatasync for pipes and some network file systems, which do not support it"""

_sync = getattr(os, "fdatasync", os.fsync)  # macOS has no fdatasync


class Syncer:
    """Thread that makes the system write an open file's new data to the disk (fdatasync).

    ``failure`` is the OSError that ended the thread, or None.
    """

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._news = threading.Event()
        self._closing = threading.Event()
        self.failure: OSError | None = None
        self._thread = threading.Thread(target=self._run, name="sync", daemon=True)
        self._thread.start()

    def written(self) -> None:
        """Request that the thread calls fdatasync, because the file has new data."""
        self._news.set()

    def close(self) -> None:
        """Stop the thread. A second call does nothing."""
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
