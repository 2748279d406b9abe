"""The contract's controller: each clause by hand, and flight against simulation."""

from __future__ import annotations

import math
import subprocess
import sys
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from heli3dof.model.control.controller import (
    _XI,
    N_OUT,
    Controller,
    control_law,
    derivative_filter,
    parameters,
    state_at_rest,
)
from heli3dof.rig.profile import ControllerSpec
from tests.model.examples import DEG, PROFILE, SPEC
from tests.pace import slower

V_O = PROFILE.motor.V_o
LEVEL = (0.0, 0.0, 0.0)


def controller(**changes: object) -> Controller:
    return Controller(SPEC.model_copy(update=changes), V_O, 24.0, 0.002)


def integrals(c: Controller) -> tuple[float, float]:
    """The integrals of the roll and the yaw error (rad·s) after the last step."""
    return c._s[_XI], c._s[_XI + 1]


def test_at_rest_on_its_reference_it_asks_for_the_hover_voltage() -> None:
    c = controller()
    c.reset((0.1, -0.2, 3.0))
    for _ in range(1000):
        command, voltage = c.step((0.1, -0.2, 3.0), (0.1, -0.2, 3.0))
    assert command == pytest.approx((V_O, V_O), abs=1e-9)
    assert voltage == command
    assert c.rates == pytest.approx((0, 0, 0), abs=1e-12)


def test_a_reference_step_is_let_through_at_45_degrees_per_second_from_the_present_angle() -> None:
    c = controller()
    c.reset((-27.5 * DEG, 0, 0))
    for _ in range(250):  # half a second
        c.step((-27.5 * DEG, 0, 0), (10 * DEG, 0, 0))
    assert c.limited_reference[0] / DEG == pytest.approx(-27.5 + 22.5)
    for _ in range(250):
        c.step((-27.5 * DEG, 0, 0), (10 * DEG, 0, 0))
    assert c.limited_reference[0] / DEG == pytest.approx(10)


def test_the_first_tick_acts_on_the_first_sample() -> None:
    # The limiter has moved by 45°/s · 2 ms = 0.09°, and nothing else is away from rest.
    c = controller()
    c.reset(LEVEL)
    command, _ = c.step(LEVEL, (10 * DEG, 0, 0))
    assert command == pytest.approx((V_O + 37.6 * 0.09 * DEG,) * 2)


def test_the_gains_act_on_the_errors_with_the_papers_signs() -> None:
    fast = {"reference_rate_limit_deg_per_s": 1e9}
    for axis, (front, back) in enumerate([(37.6, 37.6), (13.2, -13.2), (-11.5, 11.5)]):
        c = controller(**fast)
        c.reset(LEVEL)
        reference = [0.0, 0.0, 0.0]
        reference[axis] = 0.1
        command, _ = c.step(LEVEL, reference)
        assert command == pytest.approx((V_O + 0.1 * front, V_O + 0.1 * back))


def test_a_steady_rate_is_measured_and_damped() -> None:
    # Position and integral gains zero: what is left is −K_d ẏ, at 0.2 rad/s in roll.
    rates_only = tuple((0.0,) * 3 + row[3:6] + (0.0, 0.0) for row in SPEC.K)
    c = controller(K=rates_only)
    c.reset(LEVEL)
    for k in range(1000):
        command, _ = c.step((0.2 * 0.002 * k, 0, 0), LEVEL)
    assert c.rates == pytest.approx((0.2, 0, 0), abs=1e-9)
    assert command == pytest.approx((V_O - 20.9 * 0.2,) * 2)


def test_the_derivative_filter_is_the_tustin_transform_that_scipy_computes() -> None:
    from scipy.signal import bilinear

    w, zeta = 2 * math.pi * 20, 0.9
    b, a = bilinear([w**2, 0], [1, 2 * zeta * w, w**2], fs=500)
    b0, a1, a2 = derivative_filter(SPEC, 0.002)
    np.testing.assert_allclose([b0, 0, -b0], b, atol=1e-12)
    np.testing.assert_allclose([1, a1, a2], a)


def test_the_integrals_are_of_the_roll_and_the_yaw_error_in_rad_s() -> None:
    c = controller(reference_rate_limit_deg_per_s=1e9)
    c.reset(LEVEL)
    for _ in range(500):
        c.step(LEVEL, (0.1, 0.3, -0.2))
    assert integrals(c) == pytest.approx((0.1, -0.2))


def test_the_voltage_uses_the_integral_up_to_its_own_sample() -> None:
    only_integral = ((0.0,) * 6 + (10.0, -1.0), (0.0,) * 6 + (10.0, 1.0))
    c = controller(reference_rate_limit_deg_per_s=1e9, K=only_integral)
    c.reset(LEVEL)
    first, _ = c.step(LEVEL, (0.1, 0, 0))
    second, _ = c.step(LEVEL, (0.1, 0, 0))
    assert first == pytest.approx((V_O, V_O))
    assert second == pytest.approx((V_O + 10 * 0.1 * 0.002,) * 2)


def test_each_integral_contributes_at_most_7_5_volts_and_comes_back_at_once() -> None:
    only_integral = ((0.0,) * 6 + (10.0, -1.0), (0.0,) * 6 + (10.0, 1.0))
    c = controller(K=only_integral)
    c.reset(LEVEL)
    for _ in range(10_000):
        command, _ = c.step(LEVEL, (1.0, 0, 20.0))
    assert command == pytest.approx((V_O + 7.5 - 7.5, V_O + 7.5 + 7.5))
    assert integrals(c) == pytest.approx((0.75, 7.5))
    c.reset(LEVEL)
    for _ in range(10_000):
        c.step(LEVEL, (1.0, 0, 0))
    for _ in range(2):  # past the limit in the other direction: it moves from the clamp at once
        command, _ = c.step((1.5, 0, 0), (1.0, 0, 0))
    assert command[0] == pytest.approx(V_O + 7.5 - 10 * 0.5 * 0.002)


def test_the_limiter_clips_each_motor_to_v_max_and_reports_what_was_asked_for() -> None:
    c = controller(reference_rate_limit_deg_per_s=1e9)
    c.reset(LEVEL)
    command, voltage = c.step(LEVEL, (1.0, 0, 0), (0.0, -100.0))
    assert command == pytest.approx((V_O + 37.6, V_O + 37.6 - 100))
    assert voltage == (24.0, -24.0)


def test_extra_voltage_is_added_before_the_limiter() -> None:
    c = controller()
    c.reset(LEVEL)
    assert c.step(LEVEL, LEVEL, (0.5, -0.25))[0] == pytest.approx((V_O + 0.5, V_O - 0.25))


def test_reset_forgets_the_flight() -> None:
    c, fresh = controller(), controller()
    c.reset(LEVEL)
    for k in range(300):
        c.step((0.01 * math.sin(k), 0.1, 0), (1.0, 0, 1.0))
    c.reset((0.3, 0, 0))
    fresh.reset((0.3, 0, 0))
    for k in range(10):
        angle = (0.3 + 0.001 * k, 0.0, 0.0)
        assert c.step(angle, (0.5, 0, 0)) == fresh.step(angle, (0.5, 0, 0))


bad = st.sampled_from([math.nan, math.inf, -math.inf])


@given(bad, st.integers(0, 2), st.integers(0, 60))
def test_a_lost_reading_poisons_nothing(value: float, axis: int, when: int) -> None:
    c = controller()
    c.reset(LEVEL)
    for k in range(80):
        angle = [0.001 * k, 0.0, 0.0]
        if k == when:
            angle[axis] = value
        command, voltage = c.step(angle, (0.1, 0, 0))
        assert all(map(math.isfinite, (*command, *voltage)))
    assert all(map(math.isfinite, (*c.rates, *integrals(c), *c.limited_reference)))


def test_a_missing_reference_counts_as_zero_and_missing_extra_as_none() -> None:
    c, plain = controller(), controller()
    nan = math.nan
    for k in range(20):
        angle = (0.01 * k, 0.0, 0.0)
        assert c.step(angle, (nan, 0, nan), (nan, nan)) == plain.step(angle, LEVEL)


@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.floats(50, 1000),
    st.floats(0.5, 20),
    st.sampled_from([(24.0, 7.5), (5.0, 1.0)]),
)
def test_flight_and_simulation_compute_the_same_numbers(
    seed: int, rate_hz: float, size: float, limits: tuple[float, float]
) -> None:
    from heli3dof.model.control.simulated_controller import simulated_law

    rng = np.random.default_rng(seed)
    spec = ControllerSpec(
        K=tuple(tuple(row) for row in rng.normal(size=(2, 8)) * size),
        integrator_clamp_V=limits[1],
    )
    angle0 = rng.normal(size=3)
    flight = Controller(spec, V_O, limits[0], 1 / rate_hz)
    flight.reset(angle0)
    p = parameters(spec, V_O, limits[0], 1 / rate_hz)
    s, out = np.array(state_at_rest(p, angle0)), np.empty(N_OUT)
    angle = angle0.copy()
    for k in range(400):
        angle = angle + rng.normal(size=3) * 0.01
        reference, extra = rng.normal(size=3), rng.normal(size=2)
        reading = np.where(rng.random(3) < 0.02, np.nan, angle)
        command, voltage = flight.step(reading, reference, extra)
        simulated_law(np.array(p), s, reading, reference, extra, out)
        assert [*command, *voltage] == out.tolist(), k


def test_a_tick_in_flight_costs_under_30_microseconds_and_does_not_import_numba() -> None:
    c = controller()
    angle = np.array([0.01, 0.02, 0.03])
    best = math.inf
    for _ in range(20):
        start = time.perf_counter()
        for _ in range(200):
            c.step(angle, angle)
        best = min(best, (time.perf_counter() - start) / 200)
    assert best < 30e-6 * slower()
    code = (
        "import sys; from heli3dof.model.control.controller import Controller; "
        "from heli3dof.rig.profile import default_profile; "
        "c = Controller.of(default_profile()); c.step((0, 0, 0), (0, 0, 0)); "
        "print([m for m in ('numba', 'scipy', 'control') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_law_reads_lists_and_arrays_alike() -> None:
    p = parameters(SPEC, V_O, 24.0, 0.002)
    outs = []
    for make in (list, np.array):
        s, out = make(state_at_rest(p, LEVEL)), make([0.0] * N_OUT)
        control_law(make(p), s, make([0.1, 0.2, 0.3]), make([1.0, 0, 0]), make([0.0, 0]), out)
        outs.append(list(map(float, out)))
    assert outs[0] == outs[1]
