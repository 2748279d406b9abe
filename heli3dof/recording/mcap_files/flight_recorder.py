"""`RecordingWriter`: records a flight as it runs; a crash loses only the last fraction of a second.

The control loop packs and appends one row per period. Every `CHUNK_S`, one thread writes the new
rows as a chunk; another makes the system write the file to the disk (`Syncer`). A killed process
loses the chunk in progress, a power cut the last half second. If the disk is full, or
`MAX_WAITING_ROWS` rows wait to be written, the next `append` raises an error; the chunks in the
file are kept.
"""

from __future__ import annotations

import os
import threading
import time
from collections import deque
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

from heli3dof.errors import Heli3dofError, NoSpace, RecordingError, quoted
from heli3dof.recording.atomic_write import check_outputs, mode
from heli3dof.recording.mcap_files.chunk import rows_of_chunk
from heli3dof.recording.mcap_files.fsync import Syncer
from heli3dof.recording.mcap_files.mcap_writer import OUTCOME, PROFILE, PROVENANCE, McapFile
from heli3dof.recording.mcap_files.schema import RowFormat, RowPacker, message_values
from heli3dof.recording.row import Row
from heli3dof.rig.profile import Profile
from heli3dof.write_errors import FULL, write_errors_explained

CHUNK_S = 0.15
"""s, wall-clock time between two writes; the rows of this time form a chunk"""
MAX_WAITING_ROWS = 60_000
"""Largest number of rows that may wait for the disk: two minutes at 500 Hz, about 25 MB"""


class RecordingWriter:
    """Writes the recording of a flight row by row; use it as a context manager.

    ::

        with RecordingWriter(path, profile, provenance(source="flight", plan=…)) as recording:
            …
            recording.append(row)
            recording.outcome("completed")

    An exception in the block is recorded as the outcome ``error`` with its message, if `outcome`
    was not called before.
    """

    def __init__(
        self,
        path: str | Path,
        profile: Profile,
        meta: Mapping[str, Any] | None = None,
        *,
        force: bool = False,
    ) -> None:
        """Create the file and write the profile and ``meta`` (see `provenance`) to it.

        The time of this call becomes the log time of t = 0. Raises OutputExists (without
        ``force``), UsageError or NoSpace.
        """
        self.path = Path(path)
        self.start_ns = time.time_ns()
        check_outputs(self.path, force=force)
        self._queue: deque[bytes] = deque()
        self._pack = RowPacker()
        self.rows = 0
        """Number of appended rows"""
        self._outcome: dict[str, Any] = {}
        self._failure: BaseException | None = None
        self._closed = False
        self._closing = threading.Event()
        self._format = RowFormat()
        most = rows_of_chunk(self._format)
        self._buffer = memoryview(bytearray(most * self._format.stride))
        """The rows of the chunk in progress"""
        about = {"name": self.path.stem, **(meta or {}), "start_ns": self.start_ns}
        is_new = not self.path.exists()
        with write_errors_explained(self.path):
            self._stream: BinaryIO = self.path.open(  # type: ignore[assignment]
                mode(self.path, force=force), buffering=0
            )
            self._file = McapFile(self._stream, self._format)
            try:
                self._file.start({PROFILE: profile_record(profile), PROVENANCE: about})
            except BaseException:
                self._stream.close()
                if is_new:  # an existing path may be a device or a link
                    self.path.unlink(missing_ok=True)
                raise
        self._syncer = Syncer(self._stream.fileno())
        # A daemon thread does not keep a crashed program alive.
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    def append(self, row: Row) -> None:
        """Queue the row of one control period; a thread writes it to the file.

        Raises NoSpace or RecordingError if earlier rows were lost or `MAX_WAITING_ROWS` rows wait.
        """
        if self._failure is not None:
            self._raise_failure()
        if len(self._queue) >= MAX_WAITING_ROWS:
            self._raise_behind()
        log_time = self.start_ns + int(row.t * 1e9)
        self._queue.append(self._pack(self.rows, log_time, *message_values(row)))
        self.rows += 1

    def outcome(self, outcome: str, **details: Any) -> None:
        """Set how the flight ended: ``completed``, ``tripped``, ``interrupted``, ``device`` …

        `close` writes outcome and ``details`` to the file. A later call replaces an earlier one.
        """
        self._outcome = {"outcome": outcome, **details}

    def close(self) -> None:
        """Write the remaining rows, the outcome and MCAP's summary to the disk; close the file.

        Raises NoSpace or RecordingError if rows were lost. A second call does nothing.
        """
        if self._closed:
            return
        self._closed = True
        self._closing.set()
        self._thread.join()
        self._syncer.close()
        try:
            if self._failure is None or isinstance(self._failure, OSError):
                self._finish()
        finally:
            self._stream.close()
        if self._failure is not None:
            self._raise_failure()

    def __enter__(self) -> RecordingWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if error is not None and not self._outcome:
            message = error.what if isinstance(error, Heli3dofError) else str(error)
            self.outcome("error", reason=f"{type(error).__name__}: {message}")
        try:
            self.close()
        except RecordingError as lost:
            if error is None:
                raise
            error.add_note(str(lost))  # the first error is the one that propagates

    def _run(self) -> None:
        try:
            while not self._closing.wait(CHUNK_S):
                self._drain()
            self._drain()
        except BaseException as error:
            self._failure = error

    def _drain(self) -> None:
        stride, buffer, next_row = self._format.stride, self._buffer, self._queue.popleft
        n = left = len(self._queue)  # rows appended from now on wait for the next chunk
        while left:
            size = min(left * stride, len(buffer))
            for at in range(0, size, stride):
                buffer[at : at + stride] = next_row()
            self._file.write_chunk(buffer[:size])
            left -= size // stride
        if n:
            self._syncer.written()
        if self._syncer.failure is not None:
            raise self._syncer.failure

    def _finish(self) -> None:
        outcome = {"outcome": "unknown", **self._outcome, "rows": self._file.row_count}
        if self._failure is not None:
            outcome["rows_lost"] = self.rows - self._file.row_count
        keep = self._file.good
        try:
            if self._failure is not None:
                self._cut(keep)
            self._file.add_metadata(OUTCOME, outcome)
            self._file.finish()
            os.fsync(self._stream.fileno())
        except OSError as error:
            self._failure = self._failure or error
            self._cut(keep)

    def _cut(self, size: int) -> None:
        self._stream.truncate(size)
        self._stream.seek(size)
        self._file.good = size

    def _raise_behind(self) -> None:
        raise RecordingError(
            f"The disk of {self.path} is too slow: {len(self._queue)} samples wait to be written.",
            cause="it is slow, asleep or busy (a network drive, a full SD card, a backup).",
            fix="record to a local disk with -o, and copy the file afterwards",
        )

    def _raise_failure(self) -> None:
        error = self._failure
        kept = self._file.row_count
        if isinstance(error, OSError) and error.errno in FULL:
            raise NoSpace(
                f"There is no space left for {self.path}: the first {kept} of {self.rows} "
                "samples are kept, the others are lost.",
                cause="the disk or the quota is full.",
                fix=f"df -h {quoted(self.path.parent)}; free some space, then heli3dof info "
                f"{quoted(self.path)} (and heli3dof recover {quoted(self.path)} if it is torn)",
            ) from error
        raise RecordingError(
            f"The recorder of {self.path} failed after {kept} of {self.rows} samples: {error}",
            cause="the disk was unplugged or has a fault.",
            fix=f"heli3dof recover {quoted(self.path)}",
        ) from error


def profile_record(profile: Profile) -> dict[str, Any]:
    """Return the profile as the content of a metadata record of the MCAP file."""
    return {"name": profile.name, "profile": profile.to_dict()}
