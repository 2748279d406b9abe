"""`RecordingWriter`: keeps a flight while it is flown, and loses little whatever happens.

The loop's side of a row is one ``struct.pack`` and one append; a thread gathers the rows
of ``CHUNK_S`` into chunks, another sees them onto the disk. A process that is killed loses the
rows of the chunk in progress, a power cut those of the last half second; a disk that is full, or
too slow for `BEHIND_MOST` rows, is reported to the loop at its next `append`, with all earlier
chunks kept.
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

from heli3dof.errors import Heli3dofError, NoSpace, RecordingError
from heli3dof.recording.atomic_write import check_output, mode
from heli3dof.recording.mcap_files.chunk import rows_of_chunk
from heli3dof.recording.mcap_files.fsync import Syncer
from heli3dof.recording.mcap_files.mcap_writer import OUTCOME, PROFILE, PROVENANCE, McapFile
from heli3dof.recording.mcap_files.schema import RowFormat, RowPacker
from heli3dof.recording.row import Row
from heli3dof.rig.profile import Profile
from heli3dof.write_errors import FULL, explained

CHUNK_S = 0.15
"""s of wall-clock time after which a chunk is closed and handed to the system."""
_HALF, _MASK = 1 << 31, (1 << 32) - 1
"""Counts are kept in 32 bits, as encoders count them"""
BEHIND_MOST = 60_000
"""Rows that may wait for the disk: two minutes at 500 Hz, some 25 MB."""


class RecordingWriter:
    """An open recording of a flight; use it as a context manager.

    ::

        with RecordingWriter(path, profile, provenance(source="flight", plan=…)) as recording:
            …
            recording.append(row)
            recording.outcome("completed")

    Leaving the block with an exception records the outcome ``error`` and what it said.
    """

    def __init__(
        self,
        path: str | Path,
        profile: Profile,
        meta: Mapping[str, Any] | None = None,
        *,
        force: bool = False,
        start_ns: int | None = None,
    ) -> None:
        """Create the file, with the profile and ``meta`` (see ``provenance``) first.

        ``start_ns`` is t = 0 in ns since the epoch (now). Raises OutputExists, UsageError, NoSpace.
        """
        self.path = Path(path)
        self.start_ns = time.time_ns() if start_ns is None else start_ns
        check_output(self.path, force=force)
        self._rows: deque[bytes] = deque()
        self._pack = RowPacker()
        self._count = 0
        self._outcome: dict[str, Any] = {}
        self._failure: BaseException | None = None
        self._closed = False
        self._closing = threading.Event()
        self._format = RowFormat()
        most = rows_of_chunk(self._format)
        self._room = memoryview(bytearray(most * self._format.stride))
        """The rows of a chunk in progress"""
        about = {"name": self.path.stem, **(meta or {}), "start_ns": self.start_ns}
        ours_to_remove = not self.path.exists()
        with explained(self.path):
            self._stream: BinaryIO = self.path.open(  # type: ignore[assignment]
                mode(self.path, force=force), buffering=0
            )
            self._file = McapFile(self._stream, self._format)
            try:
                self._file.start({PROFILE: profile_record(profile), PROVENANCE: about})
            except BaseException:
                self._stream.close()
                if ours_to_remove:  # what stood there before may be a device, or somebody's link
                    self.path.unlink(missing_ok=True)
                raise
        self._syncer = Syncer(self._stream.fileno())
        # A daemon: a program that dies without closing must not hang on its recorder.
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    def append(self, row: Row) -> None:
        """Keep a row: a sample, the command computed from it, and what came of it.

        Raises NoSpace or RecordingError when the recorder could not keep earlier rows.
        """
        if self._failure is not None:
            self._raise_failure()
        if len(self._rows) >= BEHIND_MOST:
            self._raise_behind()
        sample = row.sample
        roll, pitch, yaw = sample.counts
        self._rows.append(
            self._pack(
                self._count,
                self.start_ns + int(row.t * 1e9),
                (
                    row.t, sample.device_time_s, row.lateness, *row.angle,
                    ((roll + _HALF) & _MASK) - _HALF, ((pitch + _HALF) & _MASK) - _HALF,
                    ((yaw + _HALF) & _MASK) - _HALF,
                    *row.applied, *sample.current, int(sample.flags) & 0xFFFFFFFF,
                    sample.sequence & 0xFFFFFFFF,
                ),
                (
                    sample.host_time_s, *row.reference, *row.limited, *row.command, *row.voltage,
                    *row.extra, row.command_sequence & 0xFFFFFFFF, row.phase,
                ),
            )
        )  # fmt: skip
        self._count += 1

    @property
    def rows(self) -> int:
        """How many rows were appended."""
        return self._count

    def outcome(self, outcome: str, **details: Any) -> None:
        """Say how the flight ended: ``completed``, ``tripped``, ``interrupted``, ``device`` …

        Written last, when the recording is closed; the last call counts.
        """
        self._outcome = {"outcome": outcome, **details}

    def close(self) -> None:
        """Write what is left, the outcome and the summary, and see them onto the disk.

        Raises NoSpace or RecordingError when not everything could be kept. Idempotent.
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
            said = error.what if isinstance(error, Heli3dofError) else str(error)
            self.outcome("error", reason=f"{type(error).__name__}: {said}")
        try:
            self.close()
        except RecordingError as lost:
            if error is None:
                raise
            error.add_note(str(lost))  # the first error is the one to report

    def _run(self) -> None:
        try:
            while not self._closing.wait(CHUNK_S):
                self._drain()
            self._drain()
        except BaseException as error:
            self._failure = error

    def _drain(self) -> None:
        stride, room, next_row = self._format.stride, self._room, self._rows.popleft
        n = left = len(self._rows)  # appends meanwhile stay behind
        while left:
            size = min(left * stride, len(room))
            for at in range(0, size, stride):
                room[at : at + stride] = next_row()
            self._file.write_chunk(room[:size])
            left -= size // stride
        if n:
            self._syncer.written()
        if self._syncer.failure is not None:
            raise self._syncer.failure

    def _finish(self) -> None:
        """Outcome and summary; after a failed write, behind the last whole chunk if they fit."""
        outcome = {"outcome": "unknown", **self._outcome, "rows": self._file.row_count}
        if self._failure is not None:
            outcome["rows_lost"] = self._count - self._file.row_count
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
            f"The disk under {self.path} does not keep up: {len(self._rows)} samples wait for it.",
            cause="it is slow, asleep or busy (a network drive, a full SD card, a backup).",
            fix="record to a local disk with -o, and copy the file afterwards",
        )

    def _raise_failure(self) -> None:
        error = self._failure
        kept = self._file.row_count
        if isinstance(error, OSError) and error.errno in FULL:
            raise NoSpace(
                f"There is no space left for {self.path}: the first {kept} of {self._count} "
                "samples are kept, the rest is lost.",
                cause="the disk or the quota is full.",
                fix=f"df -h {self.path.parent}; free some space, then heli3dof info {self.path} "
                f"(and heli3dof recover {self.path} if it is torn)",
            ) from error
        raise RecordingError(
            f"The recorder of {self.path} failed after {kept} of {self._count} samples: {error}",
            cause="the disk was unplugged or has a fault.",
            fix=f"heli3dof recover {self.path}",
        ) from error


def profile_record(profile: Profile) -> dict[str, Any]:
    """The profile as its metadata record holds it."""
    return {"name": profile.name, "profile": profile.to_dict()}
