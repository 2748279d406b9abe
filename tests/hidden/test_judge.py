"""Judgement of diagnoses, on documents written by hand."""

from __future__ import annotations

from typing import Any

import pytest

from tests.hidden.cases import Truth
from tests.hidden.judge import judge


def finding(effect: str, axis: str | None = None, *tied: str, **parameters: Any) -> dict[str, Any]:
    pairs = {n: {"value": v, "std": s} for n, (v, s) in parameters.items()}
    return {"effect": effect, "axis": axis, "parameters": pairs, "tied_with": list(tied)}


def document(*findings: dict[str, Any], leftover: str = "", verdict: str = "") -> dict[str, Any]:
    left = [{"axis": leftover, "depends_on": "pitch_rate"}] if leftover else []
    return {"findings": list(findings), "leftover": left,
            "verdict": verdict or ("explained" if findings else "nothing_found")}  # fmt: skip


def truth(**values: float) -> Truth:
    """Keyword: name with ``__`` for dots → torque_Nm."""
    named = {n.replace("__", "."): {"torque_Nm": v} for n, v in values.items()}
    return Truth(tuple(named), (), named)


COULOMB = truth(friction__coulomb__yaw=0.02)
NOTHING = Truth((), (), {})


def test_the_hidden_cause_alone_is_right_in_every_respect() -> None:
    v = judge(document(finding("friction.coulomb", "yaw", torque_Nm=(0.021, 0.001))), COULOMB)
    assert v.first
    assert v.both
    assert v.exact
    assert not v.wrong
    assert not v.alarm
    (number,) = v.numbers
    assert number.error == pytest.approx(0.05)
    assert number.covered


def test_the_axis_must_match() -> None:
    v = judge(document(finding("friction.coulomb", "roll")), COULOMB)
    assert not v.first
    assert v.wrong == ("friction.coulomb.roll",)


def test_a_finding_confounded_with_the_truth_is_neither_wrong_nor_first() -> None:
    v = judge(document(finding("friction.viscous", "yaw", "friction.coulomb.yaw")), COULOMB)
    assert not v.first
    assert v.first_or_tied
    assert v.both
    assert not v.wrong
    assert v.asserted == 0


def test_a_name_marked_as_like_is_not_asserted() -> None:
    assert judge(document(finding("friction.viscous-like", "yaw")), COULOMB).wrong == ()


def test_a_finding_confounded_only_with_an_encoder_scale_is_asserted() -> None:
    assert judge(document(finding("inertia", "yaw", "encoder.scale.yaw")), COULOMB).wrong == (
        "inertia.yaw",
    )
    hidden = truth(encoder__scale__yaw=1.25)
    assert judge(document(finding("inertia", "yaw", "encoder.scale.yaw")), hidden).wrong == ()


def test_a_false_third_name_is_wrong_and_the_set_is_not_exact() -> None:
    both = truth(friction__coulomb__yaw=0.02, bias__torque__pitch=0.01)
    result = document(
        finding("bias.torque", "pitch"), finding("friction.coulomb", "yaw"), finding("motor.delay")
    )
    v = judge(result, both)
    assert v.first
    assert v.both
    assert not v.exact
    assert v.wrong == ("motor.delay",)


def test_one_finding_confounded_with_both_causes_counts_for_one_only() -> None:
    both = truth(friction__coulomb__yaw=0.02, friction__viscous__yaw=0.1)
    v = judge(document(finding("friction.coulomb", "yaw", "friction.viscous.yaw")), both)
    assert not v.both


def test_a_confounded_finding_stays_available_for_the_other_cause() -> None:
    both = truth(friction__coulomb__yaw=0.02, friction__viscous__yaw=0.1)
    result = document(
        finding("friction.coulomb", "yaw", "friction.viscous.yaw"),
        finding("friction.coulomb", "yaw"),
    )
    assert judge(result, both).both


@pytest.mark.parametrize(
    "result",
    [
        document(finding("motor.delay")),
        document(finding("friction.coulomb", "yaw", "friction.viscous.yaw")),
        document(leftover="yaw", verdict="unexplained"),
        document(verdict="bad_data"),
    ],
)
def test_any_finding_on_an_unmodified_rig_is_a_false_alarm(result: dict[str, Any]) -> None:
    assert judge(result, NOTHING).alarm


@pytest.mark.parametrize("verdict", ["nothing_found", "off_calibration", "not_identifiable"])
def test_no_finding_on_an_unmodified_rig_is_no_alarm(verdict: str) -> None:
    assert not judge(document(verdict=verdict), NOTHING).alarm


def test_an_exact_equal_is_right_and_its_parameters_are_not_rated() -> None:
    tilted = Truth(("encoder.offset.pitch",), (), {"encoder.offset.pitch": {"angle_deg": 2.0}})
    v = judge(document(finding("aero.reaction_torque", torque_per_thrust_m=(0.023, 0.001))), tilted)
    assert v.first
    assert v.exact
    assert v.numbers == ()


def test_outside_the_catalogue_the_axis_is_required_and_any_name_is_wrong() -> None:
    name = "other.yaw_torque_from_pitch_rate"
    outside = Truth((name,), (), {name: {"damping_Nms_per_rad": 0.1}})
    assert judge(document(leftover="yaw", verdict="unexplained"), outside).axis
    assert not judge(document(leftover="roll", verdict="unexplained"), outside).axis
    assert judge(document(finding("friction.viscous", "yaw")), outside).wrong
    assert not judge(document(finding("friction.viscous-like", "yaw")), outside).wrong


def test_the_error_of_a_ratio_is_relative_to_its_distance_from_one() -> None:
    """1.06 for 1.05 is an error of 20 %, not 1 %."""
    m = Truth(("motor.thrust_mismatch",), (), {"motor.thrust_mismatch": {"front_over_back": 1.05}})
    v = judge(document(finding("motor.thrust_mismatch", front_over_back=(1.06, 0.004))), m)
    assert v.numbers[0].error == pytest.approx(0.2)
    assert not v.numbers[0].covered
