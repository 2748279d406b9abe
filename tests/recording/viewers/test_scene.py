"""The pose of the rig at angles whose picture is known by hand."""

from __future__ import annotations

from math import cos, radians, sin

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from heli3dof.recording.recording import recording_of_arrays
from heli3dof.recording.viewers.scene import Poses, parts, pivot_height, poses
from heli3dof.rig.profile import default_profile

PROFILE = default_profile()
L_A, L_H = PROFILE.geometry.L_a, PROFILE.geometry.L_h
H = pivot_height(PROFILE)


def at(roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> Poses:
    """The pose at angles in degrees."""
    angle = np.radians([[roll, pitch, yaw]] * 2)
    return poses(recording_of_arrays([0.0, 0.002], np.zeros((2, 2)), angle, PROFILE))


def in_base(pose: Poses, point: list[float]) -> np.ndarray:
    """A point of the body's frame in the base's."""
    in_arm = Rotation.from_quat(pose.body[0]).apply(point) + pose.body_origin
    return np.asarray(Rotation.from_quat(pose.arm[0]).apply(in_arm) + pose.arm_origin)


BODY, FRONT, BACK = [0.0, 0.0, 0.0], [0.0, L_H, 0.0], [0.0, -L_H, 0.0]


def test_the_level_arm_points_along_x_and_the_front_motor_along_y() -> None:
    np.testing.assert_allclose(in_base(at(), BODY), [L_A, 0, H])
    np.testing.assert_allclose(in_base(at(), FRONT), [L_A, L_H, H])


def test_10_degrees_of_roll_lift_the_body_by_L_sin_10() -> None:
    expected = [L_A * cos(radians(10)), 0, H + L_A * sin(radians(10))]
    np.testing.assert_allclose(in_base(at(roll=10), BODY), expected)


def test_positive_yaw_turns_the_arm_counter_clockwise_seen_from_above() -> None:
    np.testing.assert_allclose(in_base(at(yaw=90), BODY), [0, L_A, H], atol=1e-12)
    np.testing.assert_allclose(in_base(at(yaw=90), FRONT), [-L_H, L_A, H], atol=1e-12)


def test_positive_pitch_lifts_the_front_motor_and_lowers_the_back_motor() -> None:
    up = L_H * sin(radians(20))
    assert in_base(at(pitch=20), FRONT)[2] == pytest.approx(H + up)
    assert in_base(at(pitch=20), BACK)[2] == pytest.approx(H - up)


def test_all_three_angles_turn_in_the_order_of_the_rigid_body() -> None:
    """The thrust's direction has the lever arms of Q_r and Q_ψ in `rigid_body`."""
    r, p, y = np.radians([15.0, 25.0, 40.0])
    pose = at(15, 25, 40)
    origin = in_base(pose, BODY)
    normal = in_base(pose, [0, 0, 1]) - origin
    moment = np.cross(origin - np.array([0, 0, H]), normal)
    roll_axis = np.array([sin(y), -cos(y), 0])
    assert moment @ roll_axis == pytest.approx(L_A * cos(p))
    assert moment[2] == pytest.approx(-L_A * cos(r) * sin(p))


def test_the_body_is_just_above_the_table_at_rest() -> None:
    rest = PROFILE.encoder.roll_rest_deg
    body = next(part for part in parts(PROFILE) if part.name == "body")
    assert in_base(at(roll=rest), BODY)[2] == pytest.approx(body.size[2])


def test_the_rotors_are_at_the_ends_of_the_body() -> None:
    rotors = {part.name: part for part in parts(PROFILE) if "rotor" in part.name}
    assert rotors["front rotor"].centre[1] == L_H
    assert rotors["back rotor"].centre[1] == -L_H
    assert {part.frame for part in rotors.values()} == {"body"}


def test_a_screen_gets_60_poses_per_second() -> None:
    t = np.arange(1000) / 500
    found = poses(recording_of_arrays(t, np.zeros((1000, 2)), np.zeros((1000, 3)), PROFILE))
    assert len(found.rows) == 120
    assert np.diff(t[found.rows]).max() <= 0.018 + 1e-9


def test_an_axis_without_an_encoder_is_drawn_at_zero_and_a_gap_is_left_out() -> None:
    angle = np.full((3, 3), 0.1)
    angle[:, 2] = np.nan
    angle[1, 0] = np.nan
    found = poses(recording_of_arrays([0.0, 0.1, 0.2], np.zeros((3, 2)), angle, PROFILE))
    assert found.rows.tolist() == [0, 2]
    np.testing.assert_allclose(Rotation.from_quat(found.arm).as_euler("zyx")[:, 0], 0.0, atol=1e-12)
