"""Gap filling adds rows for lost samples, none for late ones and none in a long gap."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from heli3dof.recording.gap_filling import fill_gaps
from heli3dof.recording.recording import Recording, recording_of_arrays
from heli3dof.rig.profile import default_profile

DT = 0.002


def counting(t: np.ndarray) -> Recording:
    """Row k holds k in every column."""
    k = np.arange(len(t), dtype=float)[:, None]
    return recording_of_arrays(
        t, k * [1, 1], k * [1, 1, 1], default_profile(), reference=k * [1, 1, 1],
        voltage_extra=k * [1, 1], channels={"phase": k[:, 0]},
    )  # fmt: skip


def test_two_lost_samples_get_rows_with_the_voltage_held_and_no_angle() -> None:
    rec = counting(DT * np.delete(np.arange(100), [40, 41]))
    whole, own = fill_gaps(rec, 6.5)
    np.testing.assert_allclose(whole.t, DT * np.arange(100), atol=1e-15)
    assert whole.voltage[38:43, 0].tolist() == [38.0, 39.0, 39.0, 39.0, 40.0]
    assert whole.reference[41, 2] == 39.0
    assert whole.channels["phase"][41] == 39.0
    assert np.isnan(whole.angle[40:42]).all()
    np.testing.assert_array_equal(whole.angle[own], rec.angle)
    np.testing.assert_array_equal(whole.t[own], rec.t)


def test_a_late_sample_is_not_a_lost_one() -> None:
    t = DT * np.arange(100.0)
    t[50] += 0.8 * DT
    late = counting(t)
    assert fill_gaps(late, 6.5)[0] is late
    lost_49 = fill_gaps(counting(np.delete(t, 49)), 6.5)
    assert np.delete(np.arange(100), 49).tolist() == lost_49[1].tolist()


def test_a_long_gap_is_not_filled() -> None:
    rec = counting(DT * np.delete(np.arange(100), np.arange(40, 50)))
    whole, own = fill_gaps(rec, 6.5)
    assert whole is rec
    assert len(own) == 90


@given(st.sets(st.integers(1, 198), max_size=60))
def test_every_row_keeps_its_period_for_any_losses(lost: set[int]) -> None:
    there = np.delete(np.arange(200), sorted(lost))
    rec = counting(DT * there)
    if abs(rec.dt - DT) > 1e-9:  # most intervals are long: the period is unknown
        return
    whole, own = fill_gaps(rec, 1000.0)
    np.testing.assert_array_equal(own, there)
    np.testing.assert_allclose(whole.t, DT * np.arange(200), atol=1e-12)
