"""The integration of the plant: conservation, convergence, stops and dry friction."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from heli3dof_drivers.emulator.body import Setup, setup_of
from heli3dof_drivers.emulator.effect_spec import parse_hide
from heli3dof_drivers.emulator.effects import catalogue
from heli3dof_drivers.emulator.plant import Plant
from hypothesis import given, settings
from hypothesis import strategies as st

from heli3dof.rig.profile import default_profile
from tests.drivers.conserved import energy, travel_momentum

PROFILE = default_profile()
GRID = PROFILE.encoder.rad_per_count
FREE = replace(setup_of(PROFILE, "level"), low=(-math.inf,) * 3, high=(math.inf,) * 3)


def plant(
    setup: Setup = FREE,
    *,
    hide: str = "",
    angle=(0.0, 0.0, 0.0),
    rate=(0.0, 0.0, 0.0),
    dt: float = 0.002,
) -> Plant:
    """A plant without noise in a given state."""
    p = Plant(setup, GRID, dt=dt, hidden=parse_hide([hide]), noise=0.0)
    p._state[:6] = [*angle, *rate]
    return p


def state(p: Plant) -> tuple[np.ndarray, np.ndarray]:
    return np.array(p.truth.angle), np.array(p.truth.rate)


def test_without_thrust_energy_and_travel_momentum_are_conserved():
    p = plant(angle=(0.3, 0.5, 0.0), rate=(0.4, 2.0, 1.5))
    body = p.setup.body.vector()
    E0, L0 = energy(body, *state(p)), travel_momentum(body, *state(p))
    for _ in range(5000):
        p.step(0.0, 0.0)
    assert p.t == pytest.approx(10.0)
    assert energy(body, *state(p)) == pytest.approx(E0, rel=1e-9)
    assert travel_momentum(body, *state(p)) == pytest.approx(L0, rel=1e-9)


def test_the_energy_grows_by_the_work_of_the_thrusts():
    p = plant(angle=(0.1, 0.2, 0.0), rate=(0.2, 0.5, 0.3))
    body = p.setup.body.vector()
    E0, work, K_f = energy(body, *state(p)), 0.0, 0.1188
    L_a, L_h, F, D = 0.6604, 0.1778, K_f * 15.0, K_f * 0.2

    def power() -> float:
        (r, tilt, _), (rd, pd, yd) = state(p)
        return (
            L_a * math.cos(tilt) * F * rd
            + L_h * D * pd
            + (-L_a * math.cos(r) * math.sin(tilt) * F + L_h * math.sin(r) * D) * yd
        )

    for _ in range(500):
        before = power()
        p.step(7.6, 7.4)
        work += 0.5 * (before + power()) * 0.002
    assert energy(body, *state(p)) - E0 == pytest.approx(work, rel=1e-4)


def test_the_integration_error_is_negligible():
    ends = []
    for substeps in (4, 40):
        p = plant(angle=(0.2, 0.3, 0.0), rate=(0.5, 3.0, 2.0))
        p._substeps = substeps
        for _ in range(1000):
            p.step(8.0, 7.0)
        ends.append(state(p)[0])
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-9)


def test_the_plant_hovers_at_V_o_without_noise():
    p = Plant(setup_of(PROFILE, "level"), GRID, dt=0.002, noise=0.0, start_V=7.456)
    for _ in range(30000):
        p.step(7.456, 7.456)
    np.testing.assert_allclose(state(p)[0], 0, atol=1e-9)
    assert p.counts == (313, 0, 0)  # 27.5° / (360°/4096) = 312.9


def test_at_rest_it_is_on_the_table_with_zero_counts():
    p = Plant(setup_of(PROFILE, "rest"), GRID, dt=0.002, noise=0.0)
    for _ in range(500):
        p.step(0.0, 0.0)
        assert p.counts == (0, 0, 0)
    assert p.truth.angle[0] == pytest.approx(math.radians(-27.5), abs=1e-12)


def test_it_takes_off_only_when_thrust_exceeds_gravity():
    for volts, lifts in ((7.40, False), (7.50, True)):
        p = Plant(setup_of(PROFILE, "rest"), GRID, dt=0.002, noise=0.0)
        for _ in range(1000):
            # On the table at −27.5° gravity's torque is T_g cos 27.5°, that of 6.613 V.
            v = volts * math.cos(math.radians(27.5))
            p.step(v, v)
        assert (p.counts[0] > 0) is lifts


def test_the_table_and_the_stops_are_inelastic_and_one_sided():
    low, high, steep = math.radians(-27.5), math.radians(36), math.radians(32)
    p = plant(setup_of(PROFILE, "level"), rate=(0.0, 3.0, 0.0))
    while p.truth.angle[1] < steep - 1e-6:
        p.step(7.456, 7.456)
    assert p.t == pytest.approx(steep / 3.0, abs=0.004)
    p.step(7.456, 7.456)
    assert p.truth.angle[1] == pytest.approx(steep, abs=1e-5)  # it does not bounce
    assert p.truth.rate[1] == pytest.approx(0, abs=1e-2)
    for _ in range(1500):
        p.step(0.0, 0.0)
        assert low <= p.truth.angle[0] <= high
        assert abs(p.truth.angle[1]) <= steep
    assert p.truth.angle[0] == low  # it fell onto the table and stayed
    assert p.truth.rate[0] == pytest.approx(0, abs=1e-12)
    for _ in range(200):
        p.step(8.0, 9.0)
    assert p.truth.angle[0] > low  # the table only pushes
    assert p.truth.angle[1] < steep


def test_a_stop_never_adds_energy():
    p = plant(setup_of(PROFILE, "level"), angle=(0.5, 0.3, 0.0), rate=(1.0, 3.0, 1.0))
    body = p.setup.body.vector()
    before = energy(body, *state(p))
    for _ in range(1500):
        p.step(0.0, 0.0)
        after = energy(body, *state(p))
        assert after <= before + 1e-6  # J; the overlap of one substep with a stop is removed
        before = after


def test_dry_friction_below_its_limit_holds_without_creep():
    p = plant(hide="friction.coulomb.yaw:0.03,bias.torque.yaw:0.0299")
    for _ in range(30000):
        p.step(7.456, 7.456)
    assert abs(p.truth.angle[2]) < 1e-12


def test_dry_friction_slips_above_its_limit():
    p = plant(hide="friction.coulomb.yaw:0.03,bias.torque.yaw:0.04")
    for _ in range(500):
        p.step(7.456, 7.456)
    # ψ̈ = (0.04 − 0.03)/0.950809 = 0.0105174 rad/s²; after 1 s ½ of that.
    assert p.truth.angle[2] == pytest.approx(0.0105174 / 2, rel=1e-4)


def test_dry_friction_stops_a_coasting_arm_at_the_computed_time_and_holds_it():
    p = plant(hide="friction.coulomb.yaw:0.1", rate=(0.0, 0.0, 0.2))
    stop = 0.2 * 0.950809 / 0.1  # J ω₀ / τ_c = 1.9016 s
    while p.t < stop - 0.01:
        p.step(7.456, 7.456)
    assert p.truth.rate[2] == pytest.approx(0.01 * 0.1 / 0.950809, rel=0.3)
    for _ in range(1000):
        p.step(7.456, 7.456)
    # ½ ω₀² J / τ_c = 0.190162 rad
    assert p.truth.angle[2] == pytest.approx(0.190162, abs=2e-5)
    assert p.truth.rate[2] == pytest.approx(0, abs=1e-12)


def test_dry_friction_on_every_axis_at_once_holds_all_three():
    hide = (
        "friction.coulomb.roll:0.2,friction.coulomb.pitch:0.05,friction.coulomb.yaw:0.1,"
        "bias.torque.pitch:0.04,bias.torque.yaw:0.08,mass.imbalance:0.1"
    )
    p = plant(hide=hide, angle=(0.2, 0.1, 0.0))
    for _ in range(2000):
        p.step(7.456, 7.456)
    np.testing.assert_allclose(p.truth.angle, (0.2, 0.1, 0.0), atol=1e-9)


EXAMPLES = [e.example for e in catalogue().values()]


@settings(max_examples=30, deadline=None)
@given(
    st.lists(st.sampled_from(EXAMPLES), max_size=5, unique=True),
    st.lists(st.tuples(st.floats(-24, 24), st.floats(-24, 24)), min_size=1, max_size=12),
    st.sampled_from(["rest", "level"]),
    st.integers(0, 5),
)
def test_the_plant_stays_between_its_stops_with_any_effects_and_commands(hide, volts, start, seed):
    p = Plant(
        setup_of(PROFILE, start), GRID, dt=0.002, hidden=parse_hide(hide), seed=seed, spread=0.1
    )
    low, high = np.array(p.setup.low), np.array(p.setup.high)
    for front, back in volts:
        for _ in range(50):
            p.step(front, back)
            angle, rate = state(p)
            assert np.all((low <= angle) & (angle <= high))
            assert np.isfinite(rate).all()
