"""The body with uncoupled axes: rig.md's equations, line by line, and the way there."""

from __future__ import annotations

from math import cos, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from heli3dof.model.greybox.linearisation import _Plant
from heli3dof.model.greybox.model import nominal
from heli3dof.model.model_file import save_model
from heli3dof.model.physics import state_layout as s_
from heli3dof.model.physics.rigid_body import body_accelerations
from heli3dof.model.physics.state_layout import context
from heli3dof.paper.models import load_model
from heli3dof.rig.profile import default_profile
from tests.model.simulation_step import stepped

PROFILE = default_profile()
L_A, L_H = 0.6604, 0.1778
J_R, J_P, J_PSI = 0.914453, 0.036354, 0.950807
T_G = 2 * L_A * 0.1188 * 7.456
ALL = np.ones(3, dtype=bool)
angles, rates = st.floats(-0.5, 0.5), st.floats(-2, 2)
states = st.tuples(angles, angles, angles, rates, rates, rates)
thrusts = st.tuples(st.floats(-1, 3), st.floats(-1, 3))
shares = st.floats(-0.3, 1.3)


def acceleration(x, force, uncoupled=0.0, constant=0.0, torque=(0, 0, 0), free=ALL, **more):  # type: ignore[no-untyped-def]
    s = context(PROFILE)
    s[s_.R : s_.R + 6] = x
    s[s_.UNCOUPLED], s[s_.CONSTANT_YAW_INERTIA] = uncoupled, constant
    for name, value in more.items():
        s[getattr(s_, name)] = value
    a = np.empty(3)
    body_accelerations(s, np.array(force, float), np.array(torque, float), free, a)
    return a


def assert_sums(found, terms) -> None:  # type: ignore[no-untyped-def]
    """Each is the sum of its terms, as nearly as the printed digits tell these, however much of
    them cancels."""
    for a, each in zip(found, terms, strict=True):
        assert a == pytest.approx(sum(each), abs=1e-4 * sum(map(abs, each)) + 1e-5)


def plant(*names: str, **values: float) -> _Plant:
    return _Plant(nominal(PROFILE, names, **values))


@given(states, thrusts)
def test_with_both_left_out_the_body_is_the_equations_as_they_are_printed(x, force) -> None:  # type: ignore[no-untyped-def]
    r, p, _, rd, _, yd = x
    F, D = force[0] + force[1], force[0] - force[1]
    printed = [
        (L_A * cos(p) * F / J_R, -T_G * cos(r) / J_R, -sin(r) * cos(r) * yd**2),
        (L_H * D / J_P, sin(p) * cos(p) * rd**2, -sin(p) * cos(p) * cos(r) ** 2 * yd**2),
        (-L_A * cos(r) * sin(p) * F / J_PSI,),
    ]
    assert_sums(acceleration(x, force, 1.0, 1.0), printed)


@given(states, thrusts)
def test_simpler_still_there_are_thrust_and_gravity_alone(x, force) -> None:  # type: ignore[no-untyped-def]
    r, p = x[:2]
    F, D = force[0] + force[1], force[0] - force[1]
    simplest = [
        (L_A * cos(p) * F / J_R, -T_G * cos(r) / J_R),
        (L_H * D / J_P,),
        (-L_A * cos(r) * sin(p) * F / J_PSI, L_H * sin(r) * D / J_PSI),
    ]
    assert_sums(
        acceleration(x, force, 1.0, 1.0, WITHOUT_RATE_PRODUCTS=1.0, SIDE_THRUST=1.0), simplest
    )


def test_rates_and_side_thrust_mean_nothing_without_the_couplings_left_out() -> None:
    x, force = (0.2, 0.1, 0, 0.3, 0.4, 0.5), (1.2, 0.7)
    np.testing.assert_array_equal(
        acceleration(x, force, WITHOUT_RATE_PRODUCTS=1.0, SIDE_THRUST=1.0), acceleration(x, force)
    )


def test_tilted_both_ways_the_whole_body_pushes_its_pitch_as_the_simple_one_does_not() -> None:
    # r = 0.2, p = 0.1, F = 2 K_f V_o = 1.77155 N at rest: τ_y = −L_a cos r sin p F = −0.11447 N·m;
    # /J_ψ is −0.12039; /((J_ψ − J_p) cos² r + J_p) = 0.91471 is −0.12514; p̈ = −sin r ψ̈.
    x, force = (0.2, 0.1, 0, 0, 0, 0), (0.885773, 0.885773)
    whole, alone = acceleration(x, force), acceleration(x, force, 1.0)
    assert whole[1] == pytest.approx(-np.sin(0.2) * whole[2], rel=1e-9)
    assert whole[1] == pytest.approx(0.0249, abs=2e-4)
    assert alone[1] == 0
    assert alone[2] == pytest.approx(-0.12514, abs=1e-5)
    assert acceleration(x, force, 1.0, 1.0)[2] == pytest.approx(-0.12039, abs=1e-5)


@given(states, thrusts, shares, shares)
def test_each_share_is_a_straight_line_between_two_bodies(x, force, k, n) -> None:  # type: ignore[no-untyped-def]
    whole, alone, constant = (acceleration(x, force, *at) for at in ((0, 0), (1, 0), (0, 1)))
    expected = whole + k * (alone - whole) + n * (constant - whole)
    np.testing.assert_allclose(acceleration(x, force, k, n), expected, rtol=1e-9, atol=1e-9)


def test_level_and_at_rest_nothing_is_left_out() -> None:
    for at in ((1.0, 0.0), (0.0, 1.0)):
        np.testing.assert_allclose(
            acceleration(np.zeros(6), (1.2, 0.7), *at, torque=(0.1, 0.2, 0.3)),
            acceleration(np.zeros(6), (1.2, 0.7), torque=(0.1, 0.2, 0.3)),
            rtol=1e-9,
        )


def test_an_axis_that_is_held_stays() -> None:
    x = (0.2, 0.1, 0, 0.1, 0.1, 0.1)
    a = acceleration(x, (1.0, 0.5), 1.0, 1.0, free=np.array([False, True, False]))
    assert a[0] == a[2] == 0
    assert a[1] != 0


@pytest.mark.parametrize(("k", "n"), [(1.0, 0.0), (0.6, 0.0), (0.0, 1.0), (1.0, 1.0)])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_dry_friction_stops_a_joint_with_the_impulse_that_its_body_asks_for(
    axis: int, k: float, n: float
) -> None:
    """What friction takes off every rate is what its torque does in body_accelerations."""
    name, tau, h = ("roll", "pitch", "yaw")[axis], 0.002, 1e-4
    own = ("simplified.couplings", "simplified.yaw_inertia")
    values = {"simplified.couplings.share": k, "simplified.yaw_inertia.share": n}
    z = np.array([0.4, 0.3, 0, 0.5, 0.5, 0.5, 0.9, 0.9])
    V = np.array([0.9, 0.9]) / 0.1188
    dry = {f"friction.coulomb.{name}.torque_Nm": tau, **values}
    rough = stepped(plant(*own, f"friction.coulomb.{name}", **dry), z, V, h)
    smooth = stepped(plant(*own, **values), z, V, h)
    torque = np.zeros(3)
    torque[axis] = -tau
    at = (smooth[:6], (0.9, 0.9), k, n)
    push = acceleration(*at, torque=torque) - acceleration(*at)
    np.testing.assert_allclose((rough - smooth)[3:6], push * h, rtol=1e-6, atol=1e-13)


def test_a_model_so_written_comes_back_from_its_file(tmp_path) -> None:  # type: ignore[no-untyped-def]
    model = nominal(PROFILE, ("simplified.couplings",), **{"simplified.couplings.share": 0.9})
    back = load_model(save_model(model, tmp_path / "m.json"), PROFILE)
    q, F = np.array([0.3, 0.2, 0.0]), np.array([1.1, 0.7])
    np.testing.assert_array_equal(
        _Plant(back).acceleration(q, F),  # type: ignore[arg-type]
        _Plant(model).acceleration(q, F),
    )
