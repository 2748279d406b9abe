"""Step metrics against hand-computed numbers and symmetries."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from heli3dof_recordings import references
from hypothesis import given, settings
from hypothesis import strategies as st

from heli3dof.axes import AXES
from heli3dof.cli.flight_summary import recording_document
from heli3dof.comparison.metrics import (
    METRICS,
    StepMetrics,
    axis_metrics,
    flight_metrics,
    step_metrics,
)
from heli3dof.experiment.plan import step_plan
from heli3dof.experiment.simulate import simulate
from heli3dof.model.linear.hover import hover_model
from heli3dof.recording.mcap_files.reader import read_recording
from heli3dof.recording.recording import Recording
from heli3dof.recording.row import RAMP_DOWN
from heli3dof.rig.profile import default_profile

T = np.arange(0, 20, 0.002)


def second_order(t: np.ndarray, zeta: float = 0.5, omega: float = 2.0) -> np.ndarray:
    """Unit step response of ω²/(s² + 2ζωs + ω²)."""
    root = np.sqrt(1 - zeta**2)
    late = np.maximum(t, 0)
    wave = np.cos(omega * root * late) + zeta / root * np.sin(omega * root * late)
    return np.where(t < 0, 0.0, 1 - np.exp(-zeta * omega * late) * wave)


def first_order(t: np.ndarray, tau: float = 1.0) -> np.ndarray:
    return np.where(t < 0, 0.0, 1 - np.exp(-np.maximum(t, 0) / tau))


def step_at(
    onset_s: float, y: np.ndarray, size_deg: float, level_deg: float = 0.0, t: np.ndarray = T
) -> StepMetrics:
    reference = np.radians(np.where(t < onset_s, level_deg, level_deg + size_deg))
    return axis_metrics(t, np.radians(level_deg + size_deg * y), reference).reported


def test_a_second_order_step_overshoots_by_exp_minus_pi_zeta_over_root() -> None:
    # ζ = 0.5: exp(−π·0.5/√0.75) = 16.303 %
    m = step_at(2.0, second_order(T - 2.0), 10.0)
    assert m.kind == "step"
    assert m.overshoot_percent == pytest.approx(16.303, abs=0.001)
    assert m.overshoot_deg == pytest.approx(1.6303, abs=0.0001)
    assert m.peak_deg == pytest.approx(11.6303, abs=0.0001)
    assert m.steady_error_deg == pytest.approx(0.0, abs=1e-4)


def test_a_second_order_step_rises_and_settles_when_the_formula_says() -> None:
    # ζ = 0.5, ωt: 10 % at 0.5099, 90 % at 2.1482 (rise 1.6383/ω); last leaves ±2 % at 8.0764.
    m = step_at(2.0, second_order(T - 2.0), 10.0)
    assert m.rise_time_s == pytest.approx(1.6383 / 2, abs=0.0005)
    assert m.settling_time_s == pytest.approx(8.0764 / 2, abs=0.003)


def test_a_first_order_step_rises_in_tau_ln_9_and_settles_in_tau_ln_50() -> None:
    m = step_at(1.0, first_order(T - 1.0, 0.8), -5.0)
    assert m.rise_time_s == pytest.approx(0.8 * np.log(9), abs=1e-4)
    assert m.settling_time_s == pytest.approx(0.8 * np.log(50), abs=0.003)
    assert m.overshoot_deg == pytest.approx(0.0, abs=1e-6)
    assert m.peak_deg == pytest.approx(-5.0, abs=1e-6)


def test_a_reference_behind_a_rate_limiter_is_one_step_from_the_ramps_start() -> None:
    """0 → 10 → −6° at 40°/s, as in Simulink logs; the ramps last 0.25 and 0.4 s."""
    ramped = np.clip(40 * (T - 2), 0, 10) - np.clip(40 * (T - 12), 0, 16)
    y = 10 * second_order(T - 2) - 16 * second_order(T - 12)
    first, up, down = axis_metrics(T, np.radians(y), np.radians(ramped)).steps
    assert (first.kind, up.kind, down.kind) == ("hold", "step", "step")
    assert (up.from_deg, up.set_deg, down.from_deg, down.set_deg) == pytest.approx((0, 10, 10, -6))
    assert (up.start_s, down.start_s) == pytest.approx((2.0, 12.0), abs=0.003)
    assert up.overshoot_percent == pytest.approx(16.303, abs=0.01)
    assert up.rise_time_s == pytest.approx(1.6383 / 2, abs=0.001)
    assert up.settling_time_s == pytest.approx(8.0764 / 2, abs=0.005)


def test_peak_and_overshoot_are_both_reported() -> None:
    """E10: the hover model's 10° step peaks at 11.85°; the paper prints 12° as its overshoot."""
    m = step_at(0.0, 1.185 * first_order(T, 0.1), 10.0)
    assert (m.kind, m.from_deg, m.set_deg) == ("start", 0.0, pytest.approx(10.0))
    assert m.peak_deg == pytest.approx(11.85)
    assert m.overshoot_deg == pytest.approx(1.85)
    assert m.overshoot_percent == pytest.approx(18.5)


def test_a_flight_from_rest_is_a_step_from_the_rest_angle() -> None:
    y = np.radians(-27.5 + 37.5 * second_order(T))
    m = axis_metrics(T, y, np.full_like(T, np.radians(10.0))).reported
    assert (m.kind, m.from_deg) == ("start", -27.5)
    assert m.overshoot_percent == pytest.approx(16.303, abs=0.001)
    assert m.peak_deg == pytest.approx(10 + 0.16303 * 37.5, abs=0.001)


def test_a_response_that_stays_short_has_no_rise_or_settling_time() -> None:
    m = step_at(0.0, 0.5 * first_order(T), 10.0)
    assert np.isnan(m.rise_time_s)
    assert np.isnan(m.settling_time_s)
    assert m.overshoot_deg == pytest.approx(-5.0)  # it fell short
    assert m.steady_error_deg == pytest.approx(-5.0)


def test_a_held_axis_reports_its_farthest_angle_and_the_paper_s_largest_difference() -> None:
    y = np.radians(np.where((T > 3) & (T < 4), -7.0, 2.0) * (T > 1))
    m = axis_metrics(T, y, np.zeros_like(T)).reported
    assert m.kind == "hold"
    assert (m.peak_deg, m.overshoot_deg) == (pytest.approx(-7.0), pytest.approx(7.0))
    assert m.steady_error_deg == pytest.approx(2.0)
    assert np.isnan([m.overshoot_percent, m.rise_time_s, m.settling_time_s]).all()


def test_a_held_axis_is_counted_from_the_first_step_of_any_axis() -> None:
    """The pitch motion of the take-off must not mask that of the step."""
    roll_ref = np.radians(np.where(T < 5, 0.0, 10.0))
    reference = np.column_stack([roll_ref, np.zeros_like(T), np.zeros_like(T)])
    pitch = np.radians(np.where(T < 2, 12.0, 0.0) * (T > 0.1) + np.where(T > 6, 3.0, 0.0))
    angle = np.column_stack([roll_ref, pitch, np.zeros_like(T)])
    metrics = step_metrics(T, angle, reference)
    assert metrics["pitch"].reported.peak_deg == pytest.approx(3.0)
    assert metrics["pitch"].steps == (metrics["pitch"].reported,)
    assert metrics["roll"].reported.kind == "step"


def test_a_square_wave_gives_every_step_and_reports_the_first_commanded_one() -> None:
    level = np.where((T // 5) % 2 == 0, -10.0, 10.0)
    y = np.where(T < 5, -27.5 + 17.5 * first_order(T, 0.3), level)
    for k in (1, 2, 3):
        since = T - 5 * k
        here = since >= 0
        size = 20.0 if k % 2 else -20.0
        y = np.where(here, -size / 2 + size * second_order(since, 0.5, 8.0), y)
    m = axis_metrics(T, np.radians(y), np.radians(level))
    assert [s.kind for s in m.steps] == ["start", "step", "step", "step"]
    assert [s.set_deg for s in m.steps] == pytest.approx([-10, 10, -10, 10])
    assert m.reported == m.steps[1]
    assert m.reported.start_s == pytest.approx(5.0)
    assert [s.overshoot_percent for s in m.steps[1:]] == pytest.approx([16.303] * 3, abs=0.01)


def test_a_moving_reference_has_a_peak_and_nothing_else() -> None:
    wave = np.radians(10 * np.sin(T))
    m = axis_metrics(T, 1.2 * wave - np.radians(1.0), wave).reported
    assert m.kind == "moving"
    assert m.peak_deg == pytest.approx(-13.0, abs=1e-4)
    assert {name for name, value in m.values().items() if np.isfinite(value)} == {"peak_deg"}


def test_the_take_off_does_not_count_for_a_reference_that_moves_from_the_start() -> None:
    plan = step_plan((5.0, None, 20.0), settle_s=6.0, duration_s=6.0)
    flown = simulate(plan, hover_model(default_profile()))
    assert np.degrees(flown.angle[0, 0]) < -20
    moving = np.radians(2 * np.sin(flown.t))[:, None] * np.ones(3)
    roll = flight_metrics(replace(flown, reference=moving))["roll"]
    for m in (roll.reported, *roll.steps):
        assert m.kind == "moving"
        assert m.start_s >= 3.0
        assert 5.0 < m.peak_deg < 10.0


def test_without_a_reference_nothing_is_defined() -> None:
    m = axis_metrics(T, np.sin(T), np.full_like(T, np.nan)).reported
    assert m.kind == "none"
    assert np.isnan(list(m.values().values())).all()


def test_an_interrupted_reference_gives_no_step() -> None:
    """Open loop from 5 to 10 s: the motion there belongs to no step."""
    reference = np.radians(np.where(T < 5, 0.0, 10.0))
    reference[(T >= 5) & (T < 10)] = np.nan
    y = np.radians(np.where(T < 5, 0.0, np.where(T < 10, -20.0, 10.0)))
    m = axis_metrics(T, y, reference)
    assert [(s.kind, s.set_deg) for s in m.steps] == [("hold", 0.0), ("hold", pytest.approx(10.0))]
    assert max(s.overshoot_deg for s in m.steps) == pytest.approx(0.0, abs=1e-9)
    assert np.isfinite(m.reported.peak_deg)


def test_a_response_that_turns_to_nan_has_no_metrics() -> None:
    """A diverged model must not be measured on the part that did not diverge yet."""
    y = np.where(T < 3, 10.0 * first_order(T), np.nan)
    m = axis_metrics(T, np.radians(y), np.full_like(T, np.radians(10.0))).reported
    assert np.isnan(list(m.values().values())).all()


def test_a_settling_band_is_never_narrower_than_the_encoder() -> None:
    """2 % of 2° is less than a count of 0.088°: the quantised angle could never settle in it."""
    count = 360 / 4096
    y = 2.0 * first_order(T, 0.5)
    quantised = np.radians(np.round(y / count) * count)
    reference = np.where(T < 0.0, 0.0, np.radians(2.0))
    assert np.isfinite(
        axis_metrics(T, quantised, reference, resolution=np.radians(count)).reported.settling_time_s
    )


sizes = st.floats(1.0, 40.0)
dampings = st.floats(0.2, 0.9)
speeds = st.floats(1.0, 5.0)


@settings(max_examples=30, deadline=None)
@given(size=sizes, zeta=dampings, omega=speeds)
def test_the_mirrored_response_has_mirrored_metrics(size: float, zeta: float, omega: float) -> None:
    y = second_order(T - 1, zeta, omega)
    up, down = step_at(1.0, y, size).values(), step_at(1.0, y, -size).values()
    for name in METRICS:
        sign = -1.0 if name in ("peak_deg", "steady_error_deg") else 1.0
        assert down[name] == pytest.approx(sign * up[name], nan_ok=True, abs=1e-9)


@settings(max_examples=30, deadline=None)
@given(size=sizes, zeta=dampings, factor=st.floats(0.2, 5.0))
def test_a_slower_clock_stretches_times_and_nothing_else(
    size: float, zeta: float, factor: float
) -> None:
    y = second_order(T - 1, zeta)
    plain = step_at(1.0, y, size).values()
    slow = step_at(factor, y, size, t=factor * T).values()
    for name in METRICS:
        scale = factor if name.endswith("_s") else 1.0
        assert slow[name] == pytest.approx(scale * plain[name], nan_ok=True, rel=1e-6, abs=1e-6)


@settings(max_examples=30, deadline=None)
@given(size=sizes, zeta=dampings, level=st.floats(-20, 20))
def test_a_shifted_level_shifts_the_peak_and_nothing_else(
    size: float, zeta: float, level: float
) -> None:
    y = second_order(T - 1, zeta)
    plain, shifted = step_at(1.0, y, size).values(), step_at(1.0, y, size, level).values()
    for name in METRICS:
        offset = level if name == "peak_deg" else 0.0
        assert shifted[name] == pytest.approx(plain[name] + offset, nan_ok=True, abs=1e-6)


@pytest.fixture(scope="module")
def reference_flight() -> Recording:
    return read_recording({r.name: r.path for r in references()}["step-roll-10"])


def test_the_metrics_of_a_recording_exclude_the_ramp_to_zero_volts(
    reference_flight: Recording,
) -> None:
    """The arm sinks in the ramp, and with it the roll step would never settle."""
    r = reference_flight
    assert (r.channels["phase"] == RAMP_DOWN).any()
    assert flight_metrics(r)["roll"].reported.settling_time_s == pytest.approx(1.906, abs=0.01)
    with_ramp = step_metrics(r.t, r.angle, r.reference)["roll"].reported
    assert np.isnan(with_ramp.settling_time_s)


def test_a_landing_does_not_count_as_steady_error(reference_flight: Recording) -> None:
    angle = reference_flight.angle.copy()
    angle[reference_flight.channels["phase"] == RAMP_DOWN] = np.radians(-27.5)
    r = replace(reference_flight, angle=angle)
    assert step_metrics(r.t, r.angle, r.reference)["roll"].reported.steady_error_deg < -5
    assert abs(flight_metrics(r)["roll"].reported.steady_error_deg) < 0.2


def test_the_metrics_of_a_recording_are_those_that_the_command_line_prints(
    reference_flight: Recording,
) -> None:
    printed, metrics = recording_document(reference_flight), flight_metrics(reference_flight)
    for axis in AXES:
        error = metrics[axis].reported.steady_error_deg
        assert printed[axis]["steady_error_deg"] == pytest.approx(error)
