"""Each erratum of the paper that can be computed, computed. paper.md names these tests.

E9 (one angle called y, γ and ψ) and E15 (no hold-out record, sample rate or fit is given) are
about words; nothing in them can be computed.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from heli3dof.model.control.closed_loop_poles import (
    closed_loop,
    ideal_loop_poles,
    sampled_loop_poles,
)
from heli3dof.model.linear.hover import (
    g,
    hover,
    hover_model,
    quiescent_voltage,
)
from heli3dof.paper.eq17 import DENOMINATOR, NUMERATORS_PRINTED, paper17_model
from tests.model.control.ideal_loop import loop_poles, paper_gain, step_response, with_rotor_lag
from tests.model.examples import DEG, PRINTED_V_O, PROFILE, SPEC, K_g
from tests.pages.paper_page import taken_literally

PRINTED, RIGHT = hover(PROFILE, printed=True), hover(PRINTED_V_O)


def test_e1_table_1_taken_literally_needs_61_volts() -> None:
    assert round(quiescent_voltage(taken_literally(PROFILE))) == 61
    assert quiescent_voltage(PROFILE) < 24


def test_e2_table_1_describes_a_counterweight_heavy_arm() -> None:
    # Its torque is positive where the counterweight is the heavier side. That arm would need
    # *downward* thrust, and would rest body-up; the rig rests body-down at −27.5°.
    assert PROFILE.gravity_torque == pytest.approx(1.170, abs=5e-4)
    counterweight = 0.4699 * 1.87 * 9.81
    body = 0.6604 * 1.15 * 9.81
    assert counterweight > body
    assert quiescent_voltage(PROFILE) == pytest.approx((counterweight - body) / 0.156911, rel=1e-4)


def test_e3_with_the_printed_sign_the_gain_leaves_a_pole_at_1_469() -> None:
    assert PRINTED.A[5, 1] == pytest.approx(+1.2304, abs=5e-5)
    assert RIGHT.A[5, 1] == pytest.approx(-1.2304, abs=5e-5)
    unstable = [p for p in loop_poles(PRINTED, K_g) if p.real > 0]
    assert np.round(unstable, 3).tolist() == [1.469]
    assert (loop_poles(RIGHT, K_g).real < 0).all()


def test_e3_tilting_the_front_motor_up_pulls_the_rig_clockwise() -> None:
    # Thrust F along the body's normal, body at the end of an arm in direction (0, L_a, 0) seen
    # from above, tilt p about the arm: the horizontal part of F is −F sin p along the travel.
    F, p = 2 * 0.1188 * PROFILE.motor.V_o, 1e-3
    torque = -0.6604 * F * np.sin(p)
    assert hover(PROFILE).A[5, 1] * p == pytest.approx(torque / PROFILE.inertias[2], rel=1e-6)


def test_e4_the_printed_pitch_gain_is_too_large_by_one_over_L_h() -> None:
    assert round(PRINTED.B[4, 0], 3) == 3.268
    assert round(RIGHT.B[4, 0], 4) == 0.5810
    # N/V / (kg m²) = rad/s² per V *per metre*: an arm is missing.
    assert PRINTED.B[4, 0] * 0.1778 == pytest.approx(RIGHT.B[4, 0])


def test_e3_and_e4_only_the_corrected_model_gives_the_printed_gain() -> None:
    def reproduces(sign: float, pitch_gain: float) -> bool:
        A, B = RIGHT.A.copy(), RIGHT.B.copy()
        A[5, 1] *= sign
        B[4] *= pitch_gain / B[4, 0]
        K = paper_gain(replace(RIGHT, A=A, B=B))
        return bool(abs(K - K_g).max() < 0.1)

    right, printed = RIGHT.B[4, 0], PRINTED.B[4, 0]
    assert reproduces(+1, right)
    assert not reproduces(-1, right)
    assert not reproduces(+1, printed)
    assert not reproduces(-1, printed)


def test_e5_a_gain_plus_a_voltage_is_not_a_pair_of_voltages() -> None:
    V_o = np.full((2, 1), 7.456)
    assert (K_g + V_o).shape == (2, 8)  # (7) as printed: sixteen numbers for two motors
    error = np.zeros((8, 1))
    assert (K_g @ error + V_o).shape == (2, 1)


def test_e6_the_gain_has_two_columns_more_than_the_model_has_states() -> None:
    assert K_g.shape[1] - RIGHT.A.shape[0] == 2
    # With the two integrals a hover voltage that is 0.5 V off leaves nothing; without, 0.76°.
    left = {}
    for name, K in (("with", K_g), ("without", K_g * [1, 1, 1, 1, 1, 1, 0, 0])):
        A, _, _ = closed_loop(RIGHT.A, RIGHT.B, RIGHT.C, K)
        n = 8 if name == "with" else 6
        push = np.concatenate([RIGHT.B @ [-0.5, -0.5], np.zeros(2)])[:n]
        left[name] = np.linalg.solve(A[:n, :n], -push)[0] / DEG
    assert left["with"] == pytest.approx(0, abs=1e-9)
    assert left["without"] == pytest.approx(-0.76, abs=0.005)


def test_e7_in_degrees_a_10_degree_step_would_ask_for_376_volts() -> None:
    assert K_g[0, 0] * 10 == pytest.approx(376)
    assert K_g[0, 0] * np.radians(10) == pytest.approx(6.56, abs=0.005)


def test_e8_thrust_does_not_carry_the_weight() -> None:
    F_T = 2 * 0.1188 * quiescent_voltage(PROFILE)
    W = (1.87 + 0.575 + 0.575) * g
    assert round(F_T, 2) == 1.77
    assert round(W, 1) == 29.6
    assert pytest.approx(PROFILE.gravity_torque) == F_T * 0.6604  # (4) does hold


def test_e10_the_printed_12_degrees_is_a_peak_and_not_an_overshoot() -> None:
    roll = step_response(RIGHT, K_g, np.radians([10.0, 0, 0])).angle[:, 0] / DEG
    assert round(roll.max(), 2) == 11.85
    assert round(roll.max()) == 12
    assert round(roll.max() - 10, 2) == 1.85


def test_e11_table_2_holds_differences_from_the_experiment() -> None:
    # The text's peaks, and Table II's rows: roll and yaw, (hover, identification).
    experiment, hover_peak, identified = {"roll": 23, "yaw": 23}, {"roll": 12, "yaw": 0}, 22
    assert (experiment["roll"] - hover_peak["roll"], experiment["roll"] - identified) == (11, 1)
    assert (experiment["yaw"] - hover_peak["yaw"], experiment["yaw"] - 20) == (23, 3)
    assert (7 - 0, 7 - 7) == (7, 0)  # the yaw errors


def test_e12_the_abstract_gives_pitch_and_yaw_each_others_number() -> None:
    abstract = {"roll": 1, "pitch": 3, "yaw": 8}
    table_2 = {"roll": 1, "pitch": 8, "yaw": 3}
    assert abstract["pitch"] == table_2["yaw"] != table_2["pitch"] == abstract["yaw"]


def test_e13_pitch_stays_at_zero_by_symmetry_whatever_the_rotors_dynamics() -> None:
    # A roll step asks both motors for the same; pitch sees only their difference.
    assert K_g[0, [0, 3, 6]].tolist() == K_g[1, [0, 3, 6]].tolist()
    assert (RIGHT.B[4] @ [1, 1]) == 0
    pitch = step_response(RIGHT, K_g, np.radians([10.0, 0, 0])).angle[:, 1] / DEG
    assert abs(pitch).max() < 1e-12
    # With dynamics that the hover model leaves out, rotors lagging by 0.2 s, it is zero as well.
    lagged = step_response(with_rotor_lag(RIGHT, 0.2), K_g, np.radians([10.0, 0, 0])).angle / DEG
    assert lagged[:, 0].max() > 13  # the roll angle has noticed
    assert abs(lagged[:, 1]).max() < 1e-12


def test_e14_the_two_rows_of_equation_17_mirror_each_other_but_for_52_and_two_constants() -> None:
    front, back = (np.array(row) for row in NUMERATORS_PRINTED)
    assert front[0, 0] == 52.0
    assert back[0, 0] == -2.537
    ratio = -front[0, 1:] / back[0, 1:]
    assert ratio == pytest.approx(1, abs=0.1)
    assert front[0, 0] / -back[0, 0] > 20
    assert front[1:, -1].tolist() == [0, 0]
    assert (back[1:, -1] != 0).all()


def test_e14_fourth_order_has_no_integrator_for_yaw() -> None:
    assert abs(np.roots(DENOMINATOR)).min() > 0.5
    assert np.linalg.matrix_rank(RIGHT.A) == 4  # of 6 states: two are integrated freely


@pytest.mark.parametrize(
    ("s3", "constants", "unit"),
    list(itertools.product((52.0, 2.52), (False, True), ("radians", "degrees"))),
)
def test_e14_every_reading_of_equation_17_is_unstable_in_the_loop(
    s3: float, constants: bool, unit: str
) -> None:
    num = np.array(NUMERATORS_PRINTED)
    num[0, 0, 0] = s3
    if constants:  # the two lost ones, after T_1j ≈ −T_2j
        num[0, 1:, -1] = -num[1, 1:, -1]
    C = np.hstack(list(num)) * (DEG if unit == "radians" else 1.0)
    model = replace(paper17_model(PROFILE), C=C)
    assert ideal_loop_poles(model, SPEC)[0].real > 0.1
    assert sampled_loop_poles(model, SPEC, 0.002)[0].real > 0.1


def test_the_corrected_model_is_stable_in_every_way_that_equation_17_is_not() -> None:
    model = hover_model(PROFILE)
    assert ideal_loop_poles(model, SPEC)[0].real < -0.09
    assert sampled_loop_poles(model, SPEC, 0.002)[0].real < -0.09
