"""A profile's loop: its margins hold, its steps are flown, doubtful values are reported."""

from __future__ import annotations

import control
import numpy as np
import pytest

from heli3dof.model.control.closed_loop_poles import sampled_loop_poles
from heli3dof.model.control.loop_check import check_loop_of, disk_margin
from heli3dof.model.control.lqr import lqr_gain
from heli3dof.model.discretisation import c2d_zoh
from heli3dof.model.linear.hover import hover, hover_model
from heli3dof.rig.profile import K_G, TABLE_I, Profile, profile_from_dict
from heli3dof.rig.profile_file import merged

SMALL = {
    "geometry": {"L_w": 0.25, "L_a": 0.33, "L_h": 0.1},
    "mass": {"m_w": 0.5, "m_f": 0.25, "m_b": 0.25},
    "motor": {"V_o": 5.0, "v_max": 12.0},
}


def rig(**sections: dict[str, object]) -> Profile:
    return profile_from_dict(merged(TABLE_I, sections))


def test_the_papers_loop_is_stable_and_its_steps_are_the_golden_ones() -> None:
    found = check_loop_of(rig())
    assert found.stable
    assert found.disk_margin == pytest.approx(0.807, abs=0.002)
    take_off, roll, yaw = found.steps
    assert roll.peak_deg == pytest.approx(11.9, abs=0.2)  # 11.75 on the linear model
    assert yaw.peak_deg == pytest.approx(23.2, abs=0.2)
    assert take_off.trip is roll.trip is yaw.trip is None
    assert list(found.unusual()) == []


def test_the_loop_holds_every_pair_of_gains_within_its_margin() -> None:
    profile = rig()
    found = check_loop_of(profile)
    assert profile.controller is not None
    assert found.gain_margin is not None
    rng = np.random.default_rng(0)
    low, high = np.log(1 / found.gain_margin), np.log(found.gain_margin)
    for factors in np.exp(rng.uniform(low, high, (200, 2))):
        K = tuple(tuple(float(f * k) for k in row) for f, row in zip(factors, K_G, strict=True))
        spec = profile.controller.model_copy(update={"K": K})
        assert sampled_loop_poles(hover_model(profile), spec, profile.dt)[0].real < 0


def test_the_margin_is_no_larger_than_python_controls_for_both_motors_alike() -> None:
    profile = rig()
    h, K = hover(profile), np.array(K_G[0])
    # Roll alone, with the motors' common voltage as its one input: [r, ṙ] and the integral.
    A, B = c2d_zoh(
        np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [2 * h.B[3, 0]]]), profile.dt
    )
    z = control.tf("z")
    w = 2 * np.pi * 20.0
    s = 2 / profile.dt * (z - 1) / (z + 1)
    rate = w**2 * s / (s**2 + 2 * 0.9 * w * s + w**2)
    C = K[0] + K[3] * rate + K[6] * profile.dt / (z - 1)
    plant = control.ss2tf(control.ss(A, B, [[1.0, 0.0]], 0.0, profile.dt))
    plant.dt = C.dt = profile.dt
    alone, _, _ = control.disk_margins(
        C * plant, np.geomspace(0.05, 1000, 2000), skew=0.0, returnall=False
    )
    assert profile.controller is not None
    assert disk_margin(profile, profile.controller) <= 1.001 * alone


def test_the_design_for_a_small_rig_flies_it() -> None:
    found = check_loop_of(rig(**SMALL, controller={"K": lqr_gain(rig(**SMALL))}))
    assert found.stable
    assert found.disk_margin is not None
    assert found.disk_margin > 0.7
    assert list(found.unusual()) == []


def test_a_wrong_sign_is_unstable_and_nothing_more_is_computed() -> None:
    K = [[-k for k in K_G[0]], [-k for k in K_G[1]]]
    found = check_loop_of(rig(controller={"K": K}))
    assert not found.stable
    assert found.steps == ()
    assert found.disk_margin is None


def test_an_amplifier_that_is_too_weak_is_said_to_saturate() -> None:
    said = "\n".join(check_loop_of(rig(motor={"v_max": 8.0})).unusual())
    assert "a 10° roll step saturates" in said
    assert "safety trip" in said
