"""Arrays for the Kalman filters: time shifts of recordings."""

from __future__ import annotations

import numpy as np

from heli3dof.model.estimation.filter_data import RowRange, data_of, with_shifted_time
from heli3dof.recording.load import load
from tests.paths import ROOT


def test_a_time_shift_moves_one_recording_and_its_recorded_time_remains() -> None:
    step = load(ROOT / "recordings" / "step-roll-10.mcap")
    parts = [step.between(6.0, 9.0), step.between(9.0, 12.0)]
    data = data_of(parts, [RowRange(i, 0, len(p)) for i, p in enumerate(parts)])
    shifted = with_shifted_time(data, (0.0, 0.25))
    second = np.arange(len(data.t)) >= data.blocks[1, 0]
    np.testing.assert_allclose(shifted.t - data.t, 0.25 * second, atol=1e-12)
    np.testing.assert_allclose(shifted.recorded_t, data.t, atol=1e-12)
    assert data.recorded_t is data.t
