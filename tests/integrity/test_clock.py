"""The checks distinguish wrong time stamps from timer jitter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from heli3dof.integrity import Kind, integrity
from heli3dof.recording.logs.log_validation import timing
from heli3dof.recording.logs.sampling_clock import estimate_clock
from heli3dof.recording.recording import Recording
from tests.integrity.flights import flight, names, only, with_time


def test_lost_samples_are_counted_from_the_stamps() -> None:
    t = 0.002 * np.delete(np.arange(1000), [10, 500, 501, 502, 990])
    result = estimate_clock(t)
    assert result.lost == 5
    assert np.diff(result.number).max() == 3 + 1
    assert result.period_s == pytest.approx(0.002, rel=1e-9)


@given(
    share=st.floats(0.0, 0.05), sigma=st.floats(0.0, 0.0006), drift=st.floats(-3e-4, 3e-4),
    seed=st.integers(0, 10_000),
)  # fmt: skip
@settings(max_examples=40)
def test_the_count_is_right_under_jitter_and_drift(
    share: float, sigma: float, drift: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    n = 5000
    late = np.clip(sigma * rng.standard_normal(n), -0.0008, 0.0008)
    t = 0.002 * (1 + drift) * np.arange(n) + late
    kept = rng.random(n) >= share
    kept[[0, -1]] = True
    result = estimate_clock(t[kept])
    assert abs(result.lost - int((~kept).sum())) <= 1
    assert result.jitter_s == pytest.approx(float(np.std(late)), rel=0.05, abs=2e-6 + 3e-5 * share)


@pytest.mark.parametrize(
    ("plan", "share"), [("rich", 0.01), ("run-step", 0.002), ("run-step", 0.05)]
)
def test_simulated_gaps_are_a_finding_of_the_right_size(plan: str, share: float) -> None:
    fault = only(flight(plan, f"timing.gaps:{share}"))
    assert (fault.kind, fault.effect) == (Kind.FINDING, "timing.gaps")
    value, std = fault.parameters["lost_share"]
    assert abs(value - share) < 3.5 * std
    assert std < 0.3 * share


@pytest.mark.parametrize(
    ("plan", "jitter"), [("rich", 0.0002), ("run-step", 0.0001), ("run-step", 0.0004)]
)
def test_simulated_jitter_is_a_finding_within_five_per_cent(plan: str, jitter: float) -> None:
    fault = only(flight(plan, f"timing.jitter:{jitter}"))
    assert (fault.kind, fault.effect) == (Kind.FINDING, "timing.jitter")
    assert fault.parameters["jitter_s"][0] == pytest.approx(jitter, rel=0.05)
    assert fault.allowed_for  # the time stamps show it
    assert "the time stamps differ from an even clock by" in fault.sentence


def test_an_ordinary_timer_gives_only_a_jitter_note() -> None:
    r = flight()
    late = 4e-5 * np.abs(np.random.default_rng(1).standard_normal(len(r)))
    late[0] = 0.0
    faults = names(with_time(r, r.t + late))
    assert faults == names(with_time(r, r.t + late), Kind.NOTE) == {"timing.jitter"}


def test_rows_without_numbers_are_lost_samples() -> None:
    r = flight()
    angle = r.angle.copy()
    angle[100::50] = np.nan
    fault = only(replace(r, angle=angle))
    assert fault.effect == "timing.gaps"
    assert fault.parameters["lost_share"][0] == pytest.approx(0.02, rel=0.05)


def test_the_remedy_of_gaps_in_a_log_assumes_neither_a_port_nor_a_held_voltage() -> None:
    r = flight()
    lossy = r.rows(np.arange(len(r)) % 50 != 25)
    assert "held" in only(lossy).cause
    fault = only(replace(lossy, meta={**r.meta, "source": "import"}))
    assert not any(word in fault.cause + fault.fix for word in ("held", "port", "run-step"))


def test_a_hole_is_a_note_and_no_share_of_lost_samples() -> None:
    r = flight(rate_hz=500.0)
    cut = r.rows((r.t < 20.0) | (r.t >= 36.0))
    (note,) = integrity(cut)
    assert (note.check, note.kind, note.effect) == ("timing.hole", Kind.NOTE, None)
    assert "no samples from 20.0 to 36.0 s" in note.sentence
    lossy = cut.rows(np.arange(len(cut)) % 50 != 25)
    fault = only(lossy)
    assert fault.effect == "timing.gaps"
    assert fault.parameters["lost_share"][0] == pytest.approx(0.02, rel=0.01)
    assert "the longest interval between samples is 0.004 s" in fault.sentence


@pytest.mark.parametrize("factor", [0.5, 0.9, 1.1, 2.0])
def test_a_clock_at_another_rate_is_bad_data(factor: float) -> None:
    r = flight()
    fault = only(with_time(r, factor * r.t))
    assert (fault.check, fault.kind) == ("clock.rate", Kind.BAD_DATA)


def test_a_log_of_every_second_row_is_usable_with_a_note() -> None:
    r = flight()
    decimated = with_time(r, r.t).rows(slice(None, None, 2))
    assert names(decimated, Kind.BAD_DATA) == set()
    assert "clock.rate" in names(decimated, Kind.NOTE)


def test_milliseconds_are_named() -> None:
    fault = only(with_time(flight(), 1e3 * flight().t))
    assert "milliseconds" in fault.cause


def backwards(r: Recording) -> Recording:
    return with_time(r, np.where(r.t > 10, r.t - 3, r.t))


def repeated_stamp(r: Recording) -> Recording:
    t = r.t.copy()
    t[4000] = t[3999]
    return with_time(r, t)


@pytest.mark.parametrize("change", [backwards, repeated_stamp])
def test_time_that_does_not_increase_stops_the_checks(change) -> None:  # type: ignore[no-untyped-def]
    fault = only(change(flight()))
    assert (fault.check, fault.kind) == ("clock.order", Kind.BAD_DATA)


def test_rows_written_twice_are_detected() -> None:
    r = flight()
    twice = np.arange(len(r)) // 2 * 2
    assert "clock.repeated" in names(with_time(r.rows(twice), r.t), Kind.BAD_DATA)


def test_a_constant_voltage_with_axes_at_rest_is_not_a_repeated_row() -> None:
    r = flight("ring-down", "friction.coulomb.yaw:0.04,friction.coulomb.pitch:0.004")
    assert names(r, Kind.BAD_DATA) == set()
    twice = np.arange(len(r)) // 2 * 2
    assert "clock.repeated" in names(with_time(r.rows(twice), r.t), Kind.BAD_DATA)


@pytest.mark.parametrize("own", ["device_time_s", "sequence", "voltage_cmd"])
def test_new_samples_under_a_late_command_are_not_repeated_rows(own: str) -> None:
    """The device holds a voltage while the next command is late, and no axis turns by a count."""
    r = flight()
    late = np.arange(len(r)) % 4 == 3
    before = np.where(late, np.arange(len(r)) - 1, np.arange(len(r)))
    channels = {own: r.channels[own]} if own in r.channels else {}
    cmd = r.voltage_cmd if own == "voltage_cmd" else r.voltage_cmd[before]
    held = replace(r.rows(before), t=r.t, voltage_cmd=cmd, channels=channels)
    assert "clock.repeated" not in names(held)
    logged_twice = replace(r.rows(before), t=r.t)
    assert "clock.repeated" in names(logged_twice, Kind.BAD_DATA)


def test_a_device_clock_at_another_rate_is_detected() -> None:
    r = flight()
    channels = {**r.channels, "device_time_s": 1.02 * np.asarray(r.channels["device_time_s"])}
    assert only(replace(r, channels=channels)).check == "clock.device"


def test_gaps_have_the_length_that_import_states() -> None:
    r = flight("run-step", "timing.gaps:0.05")
    (fault,) = (f for f in integrity(r) if f.check == "timing.gaps")
    longest_s = timing(r.t).longest_gap_s
    assert f"the longest interval between samples is {longest_s:.3g} s." in fault.sentence
