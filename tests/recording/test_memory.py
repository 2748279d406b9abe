"""A flight recorded in memory equals the same flight read from a file."""

from __future__ import annotations

from dataclasses import replace
from math import nan
from pathlib import Path

import numpy as np
import pytest

from heli3dof.recording.load import load
from heli3dof.recording.mcap_files.flight_recorder import RecordingWriter
from heli3dof.recording.memory import MemoryRecorder
from heli3dof.rig.profile import default_profile
from tests.recording.make import tick


@pytest.mark.parametrize("reported", [(23.9, -23.9), (nan, nan)])
def test_a_flight_in_memory_equals_the_flight_in_the_file(
    reported: tuple[float, float], tmp_path: Path
) -> None:
    """A device need not report its output voltage; then it is the sent voltage, 24 and −24 V."""
    memory, path = MemoryRecorder(), tmp_path / "flight.mcap"
    with RecordingWriter(path, default_profile(), {}) as writer:
        for k in range(20):
            row = replace(tick(k), applied=reported)
            memory.append(row)
            writer.append(row)
        writer.outcome("completed")
    in_memory = memory.recording(default_profile(), {})
    in_file = load(path)
    for name in ("t", "voltage", "angle", "reference", "voltage_cmd", "voltage_extra"):
        np.testing.assert_array_equal(getattr(in_memory, name), getattr(in_file, name))
    assert list(in_memory.channels) == list(in_file.channels)
    for name, values in in_file.channels.items():
        np.testing.assert_array_equal(in_memory.channels[name], values)
    assert np.isfinite(in_memory.voltage).all()
