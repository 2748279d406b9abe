"""The hover model as a switch of the rigid body, and `geometry`: how much of the body is back."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from heli3dof.model.greybox.linearisation import _Plant
from heli3dof.model.greybox.model import nominal
from heli3dof.model.linear.hover import hover
from heli3dof.model.model_file import save_model
from heli3dof.model.physics import state_layout as s_
from heli3dof.model.physics.rigid_body import body_accelerations
from heli3dof.model.physics.state_layout import context
from heli3dof.paper.models import load_model
from heli3dof.rig.profile import default_profile
from tests.model.simulation_step import stepped

PROFILE = default_profile()
L_A, L_H, K_F, V_O = 0.6604, 0.1778, 0.1188, 7.456
J_R, J_P, J_PSI = 0.914453, 0.036354, 0.950807
T_G = 2 * L_A * K_F * V_O
ALL = np.ones(3, dtype=bool)
angles, rates = st.floats(-0.5, 0.5), st.floats(-2, 2)
states = st.tuples(angles, angles, angles, rates, rates, rates)
volts = st.tuples(st.floats(-5, 20), st.floats(-5, 20))


def acceleration(x, V=(V_O, V_O), linear=1.0, torque=(0, 0, 0), free=ALL, **changed):  # type: ignore[no-untyped-def]
    s = context(PROFILE)
    s[s_.R : s_.R + 6] = x
    s[s_.LINEAR] = linear
    for name, value in changed.items():
        s[getattr(s_, name)] = value
    a = np.empty(3)
    body_accelerations(s, K_F * np.array(V, float), np.array(torque, float), free, a)
    return a


def plant(*names: str, **values: float) -> _Plant:
    return _Plant(nominal(PROFILE, names, **values))


@given(states, volts)
def test_switched_on_the_body_is_the_papers_model_at_any_angle_rate_and_voltage(x, V) -> None:  # type: ignore[no-untyped-def]
    h = hover(PROFILE)
    expected = (h.A @ np.array(x) + h.B @ (np.array(V) - h.V_o))[3:]
    np.testing.assert_allclose(acceleration(x, V), expected, rtol=1e-9, atol=1e-9)


@given(states, volts)
def test_a_share_of_the_body_is_that_share_of_its_accelerations(x, V) -> None:  # type: ignore[no-untyped-def]
    whole, none = acceleration(x, V, 0.0), acceleration(x, V, 1.0)
    expected = 0.3 * whole + 0.7 * none
    np.testing.assert_allclose(acceleration(x, V, 0.7), expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("G_P", [0.0, 0.2])
def test_about_level_hover_body_and_hover_model_have_the_same_slopes(G_P: float) -> None:
    trim = np.array([V_O, V_O]) + np.array([1, -1]) * G_P / (2 * L_H * K_F)

    def slopes(linear: float) -> np.ndarray:
        e = 1e-5 * np.eye(8)
        return np.column_stack(
            [
                acceleration(d[:6], trim + d[6:], linear, G_P=G_P)
                - acceleration(-d[:6], trim - d[6:], linear, G_P=G_P)
                for d in e
            ]
        ) / (2e-5)

    np.testing.assert_allclose(acceleration(np.zeros(6), trim, G_P=G_P), 0, atol=1e-12)
    np.testing.assert_allclose(slopes(1.0), slopes(0.0), atol=1e-7)


def test_at_ten_degrees_of_roll_the_body_lacks_what_the_cosine_takes_off_gravity() -> None:
    # T_g (1 − cos 10°)/J_r = 1.1699 · 0.015192 / 0.91445 = 0.019436 rad/s²
    up = np.radians([10.0, 0, 0, 0, 0, 0])
    assert acceleration(up, linear=0.0)[0] == pytest.approx(0.019436, abs=2e-6)
    assert acceleration(up, linear=1.0)[0] == pytest.approx(0.0, abs=1e-12)


def test_effects_torques_act_on_the_level_inertias() -> None:
    x = (0.4, 0.3, 0, 0, 0, 0)
    a = acceleration(x, torque=(0.1, 0.1, 0.1)) - acceleration(x)
    np.testing.assert_allclose(a, [0.1 / J_R, 0.1 / J_P, 0.1 / J_PSI], rtol=1e-4)


def test_an_axis_that_is_held_stays() -> None:
    a = acceleration((0.2, 0.1, 0, 0, 0, 0), (9.0, 5.0), free=np.array([False, True, False]))
    np.testing.assert_allclose(a, [0, L_H * K_F * 4.0 / J_P, 0], rtol=1e-4)


def test_geometry_at_one_is_the_rigid_body_and_absent_without_its_base() -> None:
    q, F = np.array([0.3, 0.2, 0.0]), np.array([1.1, 0.7])
    rigid = plant().acceleration(q, F)
    back = plant("base.hover", "geometry", **{"geometry.share": 1.0}).acceleration(q, F)
    np.testing.assert_array_equal(back, rigid)
    alone = plant("geometry", **{"geometry.share": 0.4}).acceleration(q, F)
    np.testing.assert_array_equal(alone, rigid)
    none = plant("base.hover", "geometry", **{"geometry.share": 0.0}).acceleration(q, F)
    np.testing.assert_array_equal(none, plant("base.hover").acceleration(q, F))
    assert np.abs(none - rigid).max() > 0.05


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_dry_friction_stops_a_joint_with_the_impulse_that_its_body_asks_for(
    axis: int, share: float
) -> None:
    """What friction takes off every rate is what its torque does in body_accelerations."""
    name = ("roll", "pitch", "yaw")[axis]
    tau, h = 0.002, 1e-4
    dry = {f"friction.coulomb.{name}.torque_Nm": tau, "geometry.share": share}
    z = np.array([0.4, 0.3, 0, 0.5, 0.5, 0.5, 0.9, 0.9])
    V = np.array([0.9, 0.9]) / K_F
    rough = stepped(plant("base.hover", "geometry", f"friction.coulomb.{name}", **dry), z, V, h)
    smooth = stepped(plant("base.hover", "geometry", **{"geometry.share": share}), z, V, h)
    torque = np.zeros(3)
    torque[axis] = -tau
    x = smooth[:6]
    push = acceleration(x, linear=1 - share, torque=torque) - acceleration(x, linear=1 - share)
    np.testing.assert_allclose((rough - smooth)[3:6], push * h, rtol=1e-6, atol=1e-13)


def test_the_hover_base_flies_as_the_hover_model_linearises() -> None:
    model = nominal(PROFILE, ("base.hover",))
    here, paper = model.linear(PROFILE.dt), hover(PROFILE)
    np.testing.assert_allclose(here.continuous().A, paper.A, atol=1e-6)
    np.testing.assert_allclose(here.u0, [V_O, V_O], rtol=1e-9)


def test_a_model_with_geometry_comes_back_from_its_file(tmp_path: Path) -> None:
    model = nominal(PROFILE, ("base.hover", "geometry", "motor.lag"), **{"geometry.share": 0.97})
    n = len(model.values)
    model = replace(model, covariance=np.eye(n) * 1e-4, noise=np.array([0.03, 0.06, 0.02]))
    back = load_model(save_model(model, tmp_path / "m.json"), PROFILE)
    assert back.terms == model.terms  # type: ignore[attr-defined]
    assert back.parameters == model.parameters  # type: ignore[attr-defined]
    q, F = np.array([0.3, 0.2, 0.0]), np.array([1.1, 0.7])
    np.testing.assert_array_equal(
        _Plant(back).acceleration(q, F),  # type: ignore[arg-type]
        _Plant(model).acceleration(q, F),
    )
