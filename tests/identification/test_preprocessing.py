from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.errors import RecordingError
from heli3dof.identification.preprocessing import checked_timing, prepare, segments
from heli3dof.model.estimation.filter_data import RowRange
from heli3dof.recording.recording import Recording, recording_of_arrays
from heli3dof.rig.profile import default_profile
from tests.recording.make import changed

DT = 0.002


def flying(n: int = 10_000, seed: int = 0, t: np.ndarray | None = None) -> Recording:
    """Level flight with slowly varying angles, away from stops and limits."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) * DT if t is None else t
    angle = 0.1 * np.sin(t[:, None] * [0.7, 1.1, 0.3]) + 1e-3 * rng.standard_normal((n, 3))
    voltage = 7.4 + rng.standard_normal((n, 2))
    return recording_of_arrays(
        t, voltage, angle, default_profile(), meta={"name": f"flying-{seed}"}
    )


def test_segments_hold_mean_voltages_and_angles_at_the_interval_start() -> None:
    rec = flying()
    u, y = segments(prepare([rec]), [RowRange(0, 100, 130)], 10)[0]
    np.testing.assert_allclose(u[0], rec.voltage[100:110].mean(axis=0))
    np.testing.assert_allclose(u[2], rec.voltage[120:130].mean(axis=0))
    np.testing.assert_array_equal(y, rec.angle[[100, 110, 120]])


def test_the_mean_voltage_is_weighted_by_hold_time() -> None:
    t = np.cumsum(np.r_[0, np.tile([0.0022, 0.0018], 5000)])[:10_000]
    rec = changed(flying(t=t), "voltage", slice(0, 2), [[1.0], [2.0]])
    u, _ = segments(prepare([rec]), [RowRange(0, 0, 4)], 2)[0]
    # (1 V · 2.2 ms + 2 V · 1.8 ms) / 4 ms = 1.45 V
    np.testing.assert_allclose(u[0], 1.45)


def test_a_long_gap_ends_a_segment() -> None:
    rec = flying()
    keep = np.ones(len(rec), dtype=bool)
    keep[4000:4050] = False
    rec = rec.rows(keep)
    p = prepare([rec])
    assert [(r.start, r.stop) for r in (*p.train, *p.held_out)] == [
        (0, 4000),
        (4000, 7462),
        (7462, 9950),
    ]
    report = p.reports[0]
    assert report.timing.gaps == report.long_gaps == 1
    assert report.timing.lost_share == pytest.approx(50 / 10_000)


def test_a_lost_sample_ends_no_run() -> None:
    whole = flying()
    lost = np.arange(100, 10_000, 250)  # the last one in the held-out data
    rec = whole.rows(np.delete(np.arange(10_000), lost))
    p = prepare([rec])
    assert len(p.train) == len(p.held_out) == 1
    assert p.reports[0].timing.gaps == len(lost)
    assert p.reports[0].long_gaps == 0


def test_across_lost_samples_voltage_is_held_and_angle_interpolated() -> None:
    whole = flying()
    lost = [200, 207, 208]
    rec = whole.rows(np.delete(np.arange(10_000), lost))
    ((u, y),) = segments(prepare([rec]), [RowRange(0, 0, 997)], 10)
    ((true_u, true_y),) = segments(prepare([whole]), [RowRange(0, 0, 1000)], 10)
    assert len(y) == len(true_y) == 100
    untouched = np.delete(np.arange(100), [19, 20])
    np.testing.assert_allclose(u[untouched], true_u[untouched], rtol=1e-9)
    np.testing.assert_array_equal(np.delete(y, 20, axis=0), np.delete(true_y, 20, axis=0))
    # Sample 200 would have been picked: it lies half-way between 199 and 201.
    np.testing.assert_allclose(y[20], whole.angle[[199, 201]].mean(axis=0), rtol=1e-9)
    # Row 20 holds samples 200 … 209: the 199th's voltage, 201 … 206, the 206th's twice more, 209.
    held = whole.voltage[[199, 201, 202, 203, 204, 205, 206, 206, 206, 209]].mean(axis=0)
    # The voltage held in row 19's last sample belongs to row 19.
    np.testing.assert_allclose(u[20], held, rtol=1e-9)
    np.testing.assert_allclose(u[19], true_u[19], rtol=1e-9)


def test_the_timing_has_period_and_jitter() -> None:
    rng = np.random.default_rng(1)
    t = np.arange(5000) * DT + 1e-4 * rng.uniform(-1, 1, 5000)
    clock = checked_timing(flying(t=t, n=5000))
    assert clock.period_s == pytest.approx(DT, rel=0.02)
    # the difference of two uniform errors of ±0.1 ms: √2 · 0.1/√3 = 0.0816 ms
    assert clock.jitter_s == pytest.approx(0.0816e-3, rel=0.05)
    assert clock.gaps == 0


def test_without_held_out_recordings_the_last_quarter_is_set_aside() -> None:
    p = prepare([flying(8000)])
    assert [(r.start, r.stop) for r in p.train] == [(0, 6000)]
    assert [(r.start, r.stop) for r in p.held_out] == [(6000, 8000)]
    assert "last 25 %" in p.split


def test_held_out_recordings_are_never_fitted() -> None:
    p = prepare([flying(seed=1)], held_out=[flying(seed=2)])
    assert {r.source for r in p.train} == {0}
    assert {r.source for r in p.held_out} == {1}
    assert "flying-2" in p.split


def test_a_nan_is_left_out_and_counted() -> None:
    rec = changed(flying(), "angle", (5000, 1), np.nan)
    p = prepare([rec])
    assert p.reports[0].left_out["unread"] == pytest.approx(1e-4)
    assert all(not (r.start <= 5000 < r.stop) for r in (*p.train, *p.held_out))


def test_a_short_flight_states_which_seconds_are_left_out() -> None:
    # 1 s on the table, then 3 s of the climb
    rec = changed(flying(2000), "angle", (slice(500), 0), np.radians(-27.5))
    with pytest.raises(RecordingError) as caught:
        prepare([rec])
    assert "1.0 s on the table, 3.0 s of the climb (at least 3 s after" in caught.value.cause


def test_a_short_flight_is_not_blamed_on_its_length_if_a_trip_ended_it() -> None:
    rec = flying().rows(slice(0, 1000))
    details = {"detail": "pitch reached 61°", "fix": "a smaller step"}
    meta = {**rec.meta, "outcome": "tripped", "outcome_details": details}
    with pytest.raises(RecordingError) as caught:
        prepare([replace(rec, meta=meta)])
    assert caught.value.cause.endswith("ended for safety after 2 s: pitch reached 61°.")
    assert caught.value.fix == "a smaller step"


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda r: r.rows(slice(0, 2)), "has only 2 samples; at least 3 are needed"),
        (lambda r: r.rows(slice(0, 1000)), "only 1.5 s of 2.0 s are usable"),
        (
            lambda r: changed(r, "angle", np.s_[:, 1:], np.nan),
            "not usable alone: it holds roll, but not pitch",
        ),
        (lambda r: changed(r, "angle", np.s_[:], np.nan), "holds no angle"),
        (lambda r: changed(r, "voltage", np.s_[:], 7.4), "constant throughout"),
        (lambda r: changed(r, "t", np.s_[500], r.t[499]), "does not increase at row 501: t_s = "),
        (lambda r: changed(r, "t", np.s_[500], np.nan), "does not increase at row 501"),
    ],
)
def test_an_unusable_recording_is_rejected_with_its_reason(spoil, message) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(RecordingError, match=message) as caught:
        prepare([spoil(flying())])
    assert caught.value.fix
    assert caught.value.cause


def test_no_recording_is_an_error() -> None:
    with pytest.raises(RecordingError, match="No recording"):
        prepare([])


def test_recordings_of_two_rates_are_rejected() -> None:
    slow = flying(t=np.arange(10_000) * 0.005)
    with pytest.raises(RecordingError, match="every 5 ms"):
        prepare([flying(), slow])


def test_the_report_names_a_log_slower_than_the_loop() -> None:
    p = prepare([flying(t=np.arange(10_000) * 0.01)])
    assert any("not written at the control rate" in s for s in p.reports[0].sentences())
