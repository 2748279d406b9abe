"""The first columns of the results table."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from heli3dof.batch.recording_columns import COLUMNS, recording_columns
from heli3dof.recording.load import load
from tests.batch.small import write_small


def test_the_jitter_of_an_even_clock_is_zero(tmp_path: Path) -> None:
    """Times k·0.002 s are rounded to floats, which scatters intervals by 1e-16 s and more."""
    recording = load(write_small(tmp_path / "a.mcap"))
    row = recording_columns(recording, "a.mcap")
    assert list(row) == list(COLUMNS)
    assert row["jitter_s"] == 0.0


def test_a_jitter_of_microseconds_is_kept(tmp_path: Path) -> None:
    recording = load(write_small(tmp_path / "a.mcap"))
    late = np.random.default_rng(1).normal(0, 2e-5, len(recording))
    row = recording_columns(replace(recording, t=recording.t + late), "a.mcap")
    assert row["jitter_s"] == pytest.approx(2e-5 * np.sqrt(2), rel=0.2)


@pytest.mark.parametrize(
    ("device", "serial"),
    [
        ("mock:?seed=4", None),
        ("mock:?seed=4&spread=0.1", "mock-4"),
        ("serial:///dev/ttyACM0", "mock-4"),
    ],
)
def test_the_serial_number_identifies_a_rig(device: str, serial: str, tmp_path: Path) -> None:
    recording = load(write_small(tmp_path / "a.mcap"))
    meta = {**recording.meta, "identity": {"serial": "mock-4"}, "device": device}
    assert recording_columns(replace(recording, meta=meta), "a.mcap")["serial"] == serial
