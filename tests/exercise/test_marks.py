"""Marks by hand-computed numbers."""

from __future__ import annotations

import pytest

from heli3dof.exercise.marks import mark
from tests.exercise.making import answer, claim, truth

CABLE = ("stiffness.cable.yaw", {"stiffness_Nm_per_rad": 0.1})
INERTIA = ("inertia.roll", {"ratio": 1.5})


def test_a_right_name_with_its_size_and_interval() -> None:
    given = answer(claim(CABLE[0], 0.9, stiffness_Nm_per_rad=(0.11, 0.09, 0.13)))
    result = mark(given, truth(CABLE))
    assert (result.right, result.wrong, result.missed) == ((CABLE[0],), (), ())
    (size,) = result.sizes
    assert size.relative_error == pytest.approx(0.1)
    assert size.inside
    assert result.brier == pytest.approx(0.01)


def test_an_error_is_relative_to_the_value_without_the_effect() -> None:
    (size,) = mark(
        answer(claim("inertia.roll", None, ratio=(1.4, 1.35, 1.45))), truth(INERTIA)
    ).sizes
    assert size.relative_error == pytest.approx(0.2)
    assert not size.inside


def test_wrong_and_missed_names_cost_the_squares_of_their_confidence() -> None:
    given = answer(claim("motor.lag", 0.6), claim(CABLE[0], 0.8))
    result = mark(given, truth(CABLE, INERTIA))
    assert (result.wrong, result.missed) == (("motor.lag",), ("inertia.roll",))
    assert result.brier == pytest.approx(0.6**2 + 0.2**2 + 1)


def test_claims_of_confidence_0_do_not_improve_the_score() -> None:
    honest = mark(answer(claim(CABLE[0], 0.7)), truth(CABLE)).brier
    many = [claim(f"friction.coulomb.{a}", 0.0) for a in ("roll", "pitch", "yaw")]
    assert mark(answer(claim(CABLE[0], 0.7), *many), truth(CABLE)).brier == honest
    denied = mark(answer(claim(CABLE[0], 0.0)), truth(CABLE))
    assert (denied.right, denied.missed, denied.brier) == ((), (CABLE[0],), 1)


def test_a_claim_without_a_confidence_is_one_of_certainty() -> None:
    assert mark(answer(), truth()).brier == 0
    assert mark(answer(claim(CABLE[0]), claim("motor.lag", 0.1)), truth(CABLE)).brier == (
        pytest.approx(0.01)
    )
    assert mark(answer(claim("motor.lag")), truth(CABLE)).brier == 2


def test_none_is_right_if_nothing_is_hidden() -> None:
    assert mark(answer(claim("none", 0.75)), truth()).brier == pytest.approx(0.0625)
    result = mark(answer(claim("none", 0.75)), truth(CABLE))
    assert (result.wrong, result.brier) == (("none",), pytest.approx(1.5625))


def test_a_cause_confounded_with_a_wrong_name_is_stated() -> None:
    tied = claim("motor.lag", 0.5).model_copy(update={"tied_with": (CABLE[0],)})
    result = mark(answer(tied), truth(CABLE))
    assert (result.right, result.confounded) == ((), (CABLE[0],))


def test_a_torque_outside_the_catalogue_is_right_by_its_axis() -> None:
    other = ("other.yaw_torque_from_pitch_rate", {"damping_Nms_per_rad": 0.1})
    assert mark(answer(claim("unmodelled.yaw", 1.0)), truth(other)).right == (other[0],)
    assert mark(answer(claim("unmodelled.roll", 1.0)), truth(other)).right == ()


def test_one_claim_matches_one_cause_only() -> None:
    same = ("aero.reaction_torque", {"torque_per_thrust_m": 0.04})
    given = answer(claim("encoder.offset.pitch", 0.5), claim("aero.reaction_torque", 0.5))
    result = mark(given, truth(same))
    assert (result.right, result.wrong) == ((same[0],), ("aero.reaction_torque",))


def test_the_sign_of_a_periodic_torque_is_its_phase() -> None:
    wave = ("disturbance.periodic.yaw", {"torque_Nm": 0.02, "frequency_Hz": 0.5})
    given = claim(wave[0], 1.0, torque_Nm=(-0.02, -0.03, -0.01), frequency_Hz=(0.6, 0.5, 0.7))
    torque, frequency = mark(answer(given), truth(wave)).sizes
    assert (torque.relative_error, torque.inside) == (0.0, True)
    assert frequency.relative_error == pytest.approx(0.2)
