"""`MemoryRecorder`: records a flight in memory, for the Python API, tests and simulations."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from heli3dof.recording.mcap_files.reader import decode
from heli3dof.recording.mcap_files.schema import RowFormat, RowPacker, message_values
from heli3dof.recording.recording import Recording
from heli3dof.recording.row import Row
from heli3dof.rig.profile import Profile


class MemoryRecorder:
    """Recorder that keeps a flight's rows, one for each control period, in a list in memory."""

    def __init__(self) -> None:
        self.rows: list[Row] = []

    def append(self, row: Row) -> None:
        self.rows.append(row)

    def recording(self, profile: Profile, meta: Mapping[str, Any]) -> Recording:
        """Return the rows as a recording, equal to one read from a file of the same flight."""
        pack = RowPacker()
        packed = b"".join(pack(k, 0, *message_values(row)) for k, row in enumerate(self.rows))
        rows = RowFormat().parse(packed)
        assert rows is not None
        return decode(rows, profile, meta)
