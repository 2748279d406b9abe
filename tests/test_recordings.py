"""The reference recordings are small, contain their command, and are reproducible."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from heli3dof_recordings import references
from heli3dof_recordings.make import make

from heli3dof.recording.mcap_files.reader import read_recording

REFERENCES = references()


def test_together_they_stay_under_5_megabytes() -> None:
    assert sum(r.path.stat().st_size for r in REFERENCES) < 5e6


def test_there_are_recordings_for_both_uses() -> None:
    assert {r.use for r in REFERENCES} == {"identify", "compare"}


@pytest.mark.parametrize("reference", REFERENCES, ids=lambda r: r.name)
def test_each_contains_its_command_profile_and_seed(reference) -> None:
    recording = read_recording(reference.path)
    assert recording.meta["command_line"] == ["heli3dof", *reference.command]
    assert recording.meta["seed"] == int(reference.command[reference.command.index("--seed") + 1])
    assert recording.meta["outcome"] == "completed"
    assert recording.profile.controller_is_known
    text = json.dumps(recording.meta)
    assert "/" not in text.replace("heli3dof.recording/1", "")


def test_a_recording_is_reproducible(tmp_path: Path) -> None:
    reference = next(r for r in REFERENCES if r.name == "step-roll-10")
    kept, again = read_recording(reference.path), read_recording(make(reference, tmp_path))
    assert len(again) == len(kept)
    np.testing.assert_allclose(again.t, kept.t, atol=1e-9)
    np.testing.assert_array_equal(again.reference, kept.reference)
    # Another processor may round the last bit differently and move single counts by one.
    counts = np.abs(again.angle - kept.angle) / np.abs(kept.profile.encoder.rad_per_count)
    assert counts.max() <= 3
    assert np.mean(counts > 0.5) < 0.02
    # One count changes the derivative's voltage by a few volts for some milliseconds.
    assert np.abs(again.voltage - kept.voltage).mean() < 0.05
