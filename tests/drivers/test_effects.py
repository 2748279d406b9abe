"""Each effect against a number worked out by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from heli3dof_drivers.emulator import plant_layout
from heli3dof_drivers.emulator.body import Setup, setup_of
from heli3dof_drivers.emulator.effect_spec import parse_hide
from heli3dof_drivers.emulator.effects import catalogue
from heli3dof_drivers.emulator.plant import Plant

from heli3dof.rig.profile import default_profile
from tests.drivers.conserved import energy

PROFILE = default_profile()
GRID = PROFILE.encoder.rad_per_count
LEVEL = setup_of(PROFILE, "level")
V_o, K_f, L_a, L_h, T_g = 7.456, 0.1188, 0.6604, 0.1778, 1.16992871
J_roll, J_pitch, J_yaw = 0.914455, 0.036355, 0.950809
DT = 0.002


def plant(
    hide: str,
    *,
    angle=None,
    rate=(0.0, 0.0, 0.0),
    setup: Setup = LEVEL,
    dt: float = DT,
    start_V: float = V_o,
) -> Plant:
    p = Plant(setup, GRID, dt=dt, hidden=parse_hide([hide]), noise=0.0, start_V=start_V)
    if angle is not None:
        p._state[:3] = angle
    p._state[3:6] = rate
    return p


def acceleration(p: Plant, front: float = V_o, back: float = V_o) -> np.ndarray:
    """(3,) rad/s², mean over one short period."""
    before = np.array(p.truth.rate)
    p.step(front, back)
    return (np.array(p.truth.rate) - before) / p.dt


SHORT = 1e-5


@pytest.mark.parametrize(
    ("hide", "angle", "rate", "expected"),
    [
        # torque / inertia of its axis
        ("friction.viscous.yaw:0.05", (0, 0, 0), (0, 0, 0.4), (0, 0, -0.05 * 0.4 / J_yaw)),
        ("friction.viscous.pitch:0.05", (0, 0, 0), (0, 0.4, 0), (0, -0.05 * 0.4 / J_pitch, 0)),
        ("friction.coulomb.roll:0.02", (0, 0, 0), (-0.3, 0, 0), (0.02 / J_roll, 0, 0)),
        ("drag.quadratic.roll:0.5", (0, 0, 0), (-0.4, 0, 0), (0.5 * 0.16 / J_roll, 0, 0)),
        ("stiffness.cable.yaw:0.05", (0, 0, 2.0), (0, 0, 0), (0, 0, -0.05 * 2 / J_yaw)),
        ("bias.torque.pitch:0.02", (0, 0, 0), (0, 0, 0), (0, 0.02 / J_pitch, 0)),
        ("bias.torque.yaw:-0.02", (0, 0, 0), (0, 0, 0), (0, 0, -0.02 / J_yaw)),
        ("mass.imbalance:0.1", (0, 0, 0), (0, 0, 0), (-0.1 / J_roll, 0, 0)),
        # thrust × gain: T_g (k − 1) too much on roll
        ("motor.thrust_gain:0.9", (0, 0, 0), (0, 0, 0), (-0.1 * T_g / J_roll, 0, 0)),
        # F_f : F_b = 1.1 : 1, sum kept: F_f − F_b = F (m − 1)/(m + 1), F = 2·0.1188·7.456 N
        (
            "motor.thrust_mismatch:1.1",
            (0, 0, 0),
            (0, 0, 0),
            (0, 2 * K_f * V_o * 0.1 / 2.1 * L_h / J_pitch, 0),
        ),
        # V − 1 V on each motor
        ("motor.dead_zone:1", (0, 0, 0), (0, 0, 0), (-2 * K_f * L_a / J_roll, 0, 0)),
        # share lost: k·2·7.456
        ("motor.supply_sag:0.005", (0, 0, 0), (0, 0, 0), (-0.07456 * T_g / J_roll, 0, 0)),
        # 6 V instead of 7.456
        (
            "motor.saturation:6",
            (0, 0, 0),
            (0, 0, 0),
            (-2 * K_f * L_a * (V_o - 6) / J_roll, 0, 0),
        ),
        # the curve meets the line at V_o
        ("motor.thrust_curve:0.5", (0, 0, 0), (0, 0, 0), (0, 0, 0)),
        # κF about the normal, level: yaw only
        ("aero.reaction_torque:0.02", (0, 0, 0), (0, 0, 0), (0, 0, 0.02 * T_g / L_a / J_yaw)),
        # rising at L_a ṙ = 0.0660 m/s: the thrust drops by the share k v
        ("aero.inflow:0.3", (0, 0, 0), (0.1, 0, 0), (-0.3 * 0.06604 * T_g / J_roll, 0, 0)),
        # k·2 V_o = 0.014912 N·m·s; pitch rate turns roll, roll rate turns pitch
        ("aero.gyroscopic:0.001", (0, 0, 0), (0, 0.5, 0), (-0.014912 * 0.5 / J_roll, 0, 0)),
        ("aero.gyroscopic:0.001", (0, 0, 0), (0.5, 0, 0), (0, 0.014912 * 0.5 / J_pitch, 0)),
        ("other.yaw_torque_from_pitch_rate:0.1", (0, 0, 0), (0, 0.5, 0), (0, 0, -0.05 / J_yaw)),
        (
            "other.roll_torque_from_yaw_angle:0.1",
            (0, 0, 1.0),
            (0, 0, 0),
            (0.1 * math.sin(1.0) / J_roll, 0, 0),
        ),
        (
            "other.pitch_torque_from_voltage_product:0.0005",
            (0, 0, 0),
            (0, 0, 0),
            (0, 0.0005 * V_o**2 / J_pitch, 0),
        ),
        (
            "other.yaw_torque_from_roll_rate_squared:0.5",
            (0, 0, 0),
            (-0.4, 0, 0),
            (0, 0, -0.5 * 0.16 / J_yaw),
        ),
    ],
)
def test_an_effects_acceleration_is_its_torque_over_the_inertia(hide, angle, rate, expected):
    quiet = acceleration(plant("", angle=angle, rate=rate, dt=SHORT))
    got = acceleration(plant(hide, angle=angle, rate=rate, dt=SHORT))
    np.testing.assert_allclose(got - quiet, expected, rtol=2e-4, atol=2e-5)


def test_a_pendulums_frequency_is_the_root_of_stiffness_over_inertia():
    # ω = √(k/J_roll). Small angles: gravity's torque falls with cos r, the thrust does not.
    p = plant("stiffness.pendulum.roll:1.0", angle=(1e-3, 0, 0))
    crossings = []
    while len(crossings) < 3:
        before = p.truth.angle[0]
        p.step(V_o, V_o)
        if before * p.truth.angle[0] <= 0:
            crossings.append(p.t)
    assert 2 * (crossings[2] - crossings[1]) == pytest.approx(
        2 * math.pi * math.sqrt(J_roll / 1.0), rel=2e-3
    )


def test_an_inertia_ratio_divides_the_acceleration_of_its_axis():
    for axis, (front, back), a in (
        ("roll", (V_o + 1, V_o + 1), 2 * K_f * L_a / J_roll),
        ("pitch", (V_o + 1, V_o - 1), 2 * K_f * L_h / J_pitch),
    ):
        got = acceleration(plant(f"inertia.{axis}:1.25", dt=SHORT), front, back)
        assert got[("roll", "pitch").index(axis)] == pytest.approx(a / 1.25, rel=1e-4)


def test_a_curved_thrust_is_steeper_at_hover_and_odd_in_voltage():
    # d/dV [(1 − s) V + s V²/V_o] at V_o = 1 + s
    up = acceleration(plant("motor.thrust_curve:0.5", dt=SHORT), V_o + 0.01, V_o + 0.01)
    assert up[0] == pytest.approx(1.5 * 2 * K_f * L_a * 0.01 / J_roll, rel=1e-3)
    forth, back = (
        acceleration(plant("motor.thrust_curve:0.5", dt=SHORT), v, v)[0] for v in (3.0, -3.0)
    )
    assert forth + T_g / J_roll == pytest.approx(-(back + T_g / J_roll), rel=1e-4)


def test_a_rotors_lag_is_first_order_and_starts_in_hover():
    p = plant("motor.lag:0.1")
    assert p.truth.thrust == pytest.approx((K_f * V_o, K_f * V_o))
    for _ in range(50):  # 0.1 s, one time constant
        p.step(10.0, 7.456)
    expected = K_f * (10 + (V_o - 10) * math.exp(-1))
    assert p.truth.thrust[0] == pytest.approx(expected, rel=1e-9)
    assert p.truth.thrust[1] == pytest.approx(K_f * V_o, rel=1e-9)


@pytest.mark.parametrize("delay_ms", [2.0, 2.8, 7.3, 20.0, 100.0])
def test_a_delay_shifts_a_step_by_exactly_the_delay(delay_ms):
    p = plant(f"motor.delay:{delay_ms / 1000}")
    a = 2 * K_f * L_a * 1.0 / J_roll
    n = 100
    for _ in range(n):
        p.step(V_o + 1, V_o + 1)
    # A step of acceleration a that began at the delay: rate a (t − T).
    assert p.truth.rate[0] == pytest.approx(a * (n * DT - delay_ms / 1000), rel=3e-4)


def test_the_periodic_torque_starts_at_zero_and_is_a_sine():
    p = plant("disturbance.periodic.yaw:0.02@0.5")
    for _ in range(500):
        p.step(V_o, V_o)
    # ψ̇(1 s) = τ/J ∫ sin(πt) dt = τ/J · 2/π
    assert p.truth.rate[2] == pytest.approx(0.02 / J_yaw * 2 / math.pi, rel=1e-4)


def test_an_added_mass_acts_from_its_time_with_weight_and_inertia():
    p = plant("mass.change:0.05@1")
    for _ in range(500):
        p.step(V_o, V_o)
    assert abs(p.truth.rate[0]) < 1e-9
    # −m g L_a / (J_roll + m L_a²) = −0.323926/(0.914455 + 0.021806)
    assert acceleration(p)[0] == pytest.approx(-0.345978, rel=1e-3)


def test_a_drift_takes_thrust_in_proportion_to_time():
    p = plant("motor.thrust_drift:0.01")
    for _ in range(500):
        p.step(V_o, V_o)
    # The lost share 0.01 t of the thrust turns the arm: ṙ(1 s) = −T_g/J_roll · 0.01 · 1²/2,
    # a little less because the arm falls by 0.1°.
    assert p.truth.rate[0] == pytest.approx(-0.005 * T_g / J_roll, rel=1e-3)
    # A negative thrust stays: q̈ = −2 T_g/J_roll.
    pushed = plant("motor.thrust_drift:0.01", dt=SHORT)
    assert acceleration(pushed, -V_o, -V_o)[0] == pytest.approx(-2 * T_g / J_roll, rel=1e-3)


def test_ground_effect_increases_the_thrust_near_the_table_only():
    on = setup_of(PROFILE, "rest").start
    for angle, share in ((on, 0.2), ((0.0, 0.0, 0.0), 0.2 * math.exp(-0.304934 / 0.1))):
        # L_a sin 27.5° = 0.304934 m
        p = plant("aero.ground_effect:0.2@0.1", angle=angle, dt=SHORT)
        q = plant("", angle=angle, dt=SHORT)
        more = acceleration(p, 12, 12)[0] - acceleration(q, 12, 12)[0]
        assert more == pytest.approx(share * 2 * K_f * 12 * L_a / J_roll, rel=1e-3)


def test_ground_effect_turns_a_tilted_body_back_to_level():
    level, tilted = ((0.0, angle, 0.0) for angle in (0.0, 0.3))
    effect = "aero.ground_effect:0.2@0.1"
    assert acceleration(plant(effect, angle=level, dt=SHORT), 12, 12)[1] == pytest.approx(
        0, abs=1e-9
    )
    more = acceleration(plant(effect, angle=tilted, dt=SHORT), 12, 12)[1]
    tip = L_h * math.sin(0.3)
    lift = 0.2 * 12 * K_f * (math.exp(-(0.304934 + tip) / 0.1) - math.exp(-(0.304934 - tip) / 0.1))
    free = acceleration(plant("", angle=tilted, dt=SHORT), 12, 12)[1]
    assert more - free == pytest.approx(L_h * lift / J_pitch, rel=1e-2)


def test_gyroscopic_torque_does_no_work():
    free = replace(LEVEL, low=(-math.inf,) * 3, high=(math.inf,) * 3)
    p = plant("aero.gyroscopic:0.01", angle=(0.2, 0.3, 0), rate=(0.5, 2, 1), setup=free)
    body = p.setup.body.vector()
    p._body[plant_layout.K_F] = 0.0  # propellers that turn without thrust
    before = energy(body, np.array(p.truth.angle), np.array(p.truth.rate))
    for _ in range(2000):
        p.step(10.0, 10.0)
    after = energy(body, np.array(p.truth.angle), np.array(p.truth.rate))
    assert after == pytest.approx(before, rel=1e-8)


def swing(hide: str, **kwargs) -> tuple[np.ndarray, np.ndarray]:
    """True and measured angles, rad, of a pitch swing up and back."""
    p = plant(hide, **kwargs)
    rest, true, read = PROFILE.encoder.rest_rad, [], []
    for k in range(600):
        v = 0.3 * math.cos(2 * math.pi * k / 600)
        p.step(V_o + v, V_o - v)
        true.append(p.truth.angle)
        read.append(rest + np.array(p.counts) * GRID)
    return np.array(true), np.array(read)


def test_without_effects_a_reading_is_within_half_a_count_of_the_angle():
    true, read = swing("")
    assert np.abs(true - read).max() <= np.abs(GRID).max() / 2 * (1 + 1e-9)


def test_backlash_lags_by_half_its_width_in_each_direction():
    true, read = swing("encoder.backlash.pitch:0.5")
    gap = np.degrees(true - read)[:, 1]
    count = 360 / 4096
    assert gap.max() == pytest.approx(0.25, abs=count)
    assert gap.min() == pytest.approx(-0.25, abs=count)
    assert abs(np.degrees(true - read)[:, 0]).max() < count


def test_an_offset_shifts_the_reading_of_a_level_rig():
    p = plant("encoder.offset.pitch:2.0")
    assert p.counts[1] == 0
    assert math.degrees(p.truth.angle[1]) == pytest.approx(-2.0)
    true, read = swing("encoder.offset.pitch:2.0")
    assert np.degrees(read - true)[:, 1] == pytest.approx(2.0, abs=0.05)


def test_a_roll_offset_moves_the_table_so_that_power_up_counts_zero():
    p = plant("encoder.offset.roll:1.5", setup=setup_of(PROFILE, "rest"), start_V=0)
    for _ in range(100):
        p.step(0, 0)
        assert p.counts == (0, 0, 0)
    assert math.degrees(p.truth.angle[0]) == pytest.approx(-29.0)


def test_a_scale_stretches_the_reading_from_rest():
    rest = setup_of(PROFILE, "rest")
    p = plant("encoder.scale.roll:1.05", setup=rest, start_V=0)
    assert p.counts[0] == 0
    p._state[0] = 0.0
    p.step(V_o, V_o)
    assert p.counts[0] == round(1.05 * 27.5 / 360 * 4096)
    assert plant("encoder.scale.roll:1.05").counts[0] == 313  # held at the angle that reads level


def test_a_negative_resolution_makes_the_count_fall_as_the_angle_rises():
    p = Plant(LEVEL, GRID * [-1, 1, -1], dt=DT, noise=0.0, start_V=V_o)
    assert p.counts == (-313, 0, 0)


def test_jittered_samples_keep_their_order_and_have_the_given_spread():
    p = plant("timing.jitter:0.0002")
    t = []
    for _ in range(4000):
        p.step(V_o, V_o)
        t.append(p.t)
    late = np.array(t) - DT * np.arange(1, 4001)
    assert np.all(np.diff(t) > 0)
    assert late.std() == pytest.approx(0.0002, rel=0.05)
    assert abs(late.mean()) < 2e-5


def test_jitter_changes_the_sampling_and_not_the_motion():
    quiet, jittery = plant(""), plant("timing.jitter:0.0005")
    for _ in range(500):
        quiet.step(V_o + 1, V_o + 1)
        jittery.step(V_o + 1, V_o + 1)
    a = 2 * K_f * L_a / J_roll
    assert jittery.truth.rate[0] == pytest.approx(a * jittery.t, rel=1e-2)
    assert jittery.t != quiet.t


def test_the_share_of_lost_samples_is_the_given_one():
    p = plant("timing.gaps:0.05")
    lost = sum(not p.step(V_o, V_o) for _ in range(4000))
    assert lost / 4000 == pytest.approx(0.05, abs=0.01)


@pytest.mark.parametrize("name", catalogue())
def test_every_effect_changes_the_motion_and_stays_finite(name):
    example = catalogue()[name].example.replace("@20", "@0.5")
    # All inputs oscillate, far enough to reach the limits.
    quiet, p = (
        Plant(LEVEL, GRID, dt=DT, hidden=parse_hide([h]), noise=0.0, start_V=V_o)
        for h in ("", example)
    )
    differs = False
    for k in range(1000):
        c, d = 3 * math.sin(k / 60), 0.6 * math.cos(k / 25)
        arrived = p.step(V_o + c + d, V_o + c - d)
        quiet.step(V_o + c + d, V_o + c - d)
        differs = differs or p.counts != quiet.counts or p.t != quiet.t or not arrived
    assert differs
    assert np.isfinite(p._state).all()
