"""Block bootstrap of one recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from heli3dof.batch.bootstrap import BLOCK_S, PAUSE_S, block_replicate, named_shares
from heli3dof.errors import RecordingError
from heli3dof.recording.recording import Recording, recording_of_arrays
from heli3dof.rig.profile import default_profile


def recording(seconds: float) -> Recording:
    """500 Hz; the roll angle is the number of the sample."""
    t = np.arange(round(seconds * 500)) * 0.002
    angle = np.zeros((len(t), 3))
    angle[:, 0] = np.arange(len(t))
    return recording_of_arrays(t, np.zeros((len(t), 2)), angle, default_profile())


def test_a_replicate_consists_of_whole_blocks_in_the_order_of_time() -> None:
    r = recording(41.0)
    x = block_replicate(r, 1)
    assert len(x) == 8 * 2500  # 41 s hold 8 blocks of 5 s
    blocks = x.angle[:, 0].reshape(8, 2500)
    assert (np.diff(blocks, axis=1) == 1).all()
    assert (blocks[:, 0] % 2500 == 0).all()
    assert (np.diff(blocks[:, 0]) >= 0).all()


def test_a_pause_separates_the_blocks() -> None:
    x = block_replicate(recording(40.0), 3)
    gaps = np.diff(x.t)
    assert np.count_nonzero(gaps > 0.5) == 7
    assert gaps.max() == pytest.approx(PAUSE_S + 0.002)
    assert x.t[2500] == pytest.approx(BLOCK_S + PAUSE_S)


def test_replicates_differ_and_are_reproducible() -> None:
    r = recording(40.0)
    first, again, second = (block_replicate(r, k).angle[:, 0] for k in (1, 1, 2))
    assert (first == again).all()
    assert (first != second).any()
    assert block_replicate(r, 0) is r


def test_a_block_is_drawn_as_often_as_it_is_left_out_on_average() -> None:
    r = recording(50.0)
    drawn = [block_replicate(r, k).angle[::2500, 0] // 2500 for k in range(1, 301)]
    missing = np.mean([10 - len(np.unique(d)) for d in drawn])
    assert missing == pytest.approx(10 * 0.9**10, abs=0.25)  # 10 (1 − 1/10)¹⁰ = 3.49


def test_a_short_recording_is_refused() -> None:
    with pytest.raises(RecordingError, match="too short for a bootstrap"):
        block_replicate(recording(29.0), 1)


def test_the_share_counts_confounded_causes_and_leaves_out_failures() -> None:
    rows = [
        {"exit_code": 0, "replicate": 0, "causes": "motor.lag"},
        {"exit_code": 0, "replicate": 1, "causes": "timing.gaps; motor.lag|motor.delay"},
        {"exit_code": 0, "replicate": 2, "causes": "motor.delay"},
        {"exit_code": 0, "replicate": 3, "causes": None},
        {"exit_code": 0, "replicate": 4, "causes": "motor.lag"},
        {"exit_code": 1, "replicate": 5, "causes": None},
    ]
    shares = named_shares(rows)
    assert [(s.cause, s.named, s.of, s.in_recording) for s in shares] == [
        ("motor.delay", 2, 4, False),
        ("motor.lag", 2, 4, True),
    ]
    low, high = shares[0].interval  # Wilson, 2 of 4: 0.5 ± 0.35
    assert (low, high) == (pytest.approx(0.150, abs=1e-3), pytest.approx(0.850, abs=1e-3))


def test_without_replicates_there_are_no_shares(tmp_path: Path) -> None:
    assert named_shares([{"exit_code": 0, "replicate": 0, "causes": "motor.lag"}]) == []
