"""The verdict is ambiguous if the first finding is confounded, whichever kind it is."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from heli3dof.diagnosis.calibration import Calibrated, Off
from heli3dof.diagnosis.document import diagnosis_document
from heli3dof.diagnosis.result import Diagnosis, Finding, in_order, verdict_of
from heli3dof.diagnosis.select import Choice
from heli3dof.model.effects import terms
from heli3dof.rig.profile import default_profile


def off(*tied: str) -> Off:
    return Off(terms(["inertia.roll"])[0], 1.4, 0.03, 60.0, tied_with=tied)


def finding(*tied: str) -> Any:
    cause = terms(["motor.lag"])[0]
    choice = Choice(cause, 50.0, 60.0, 1.0, tied, ())
    return Finding(choice, {}, cast(Any, None), np.zeros(4))


@pytest.mark.parametrize(
    ("findings", "offs", "left", "verdict"),
    [
        ([], [], [], "nothing_found"),
        ([finding()], [], [], "explained"),
        ([finding("motor.delay")], [], [], "ambiguous"),
        ([], [off()], [], "explained"),
        ([], [off("motor.thrust_curve")], [], "ambiguous"),
        ([finding()], [off("motor.thrust_curve")], [], "explained"),
        ([finding("motor.delay")], [], [SimpleNamespace()], "unexplained"),
        ([], [], [SimpleNamespace()], "unexplained"),
    ],
)
def test_the_first_finding_decides_whether_the_verdict_is_ambiguous(
    findings: Any, offs: Any, left: Any, verdict: str
) -> None:
    assert verdict_of([*findings, *offs], left) == verdict


def test_findings_are_ordered_by_strength_and_causes_keep_their_order() -> None:
    lag, inertia = finding(), off()
    late = replace(lag, choice=replace(lag.choice, score=70.0))
    assert in_order([], [lag, late], [inertia]) == (inertia, lag, late)
    assert in_order([], [late, lag], [inertia]) == (late, inertia, lag)


def test_a_confounded_base_parameter_requests_the_plan_that_separates_it() -> None:
    tied = Diagnosis(("a",), (), "ambiguous", (), calibration_findings=(off("motor.thrust_curve"),))
    plan = diagnosis_document(tied)["next_experiment"]
    assert plan["plan"] == terms(["inertia.roll"])[0].effect.separated_by
    assert plan["separates"] == ["inertia.roll", "motor.thrust_curve"]


def test_beyond_tolerance_has_three_values() -> None:
    numbers = tuple(
        Calibrated(name, 1.0, value, 0.03, "kg·m²", 0.03)
        for name, value in (("T_g", 0.79), ("J_roll", 1.4), ("J_pitch", 1.12), ("J_yaw", 0.83))
    )
    model = SimpleNamespace(profile=default_profile())
    gain = SimpleNamespace(before={}, after={}, log_likelihood=None, rmse_deg={}, on="holdout")
    fitted = SimpleNamespace(
        final=None, open=None, model=model, calibration=numbers, gain=gain, noise_floor={},
        wrong=SimpleNamespace(horizons_s=(), worst=(), at=lambda h, axis: (1.0, 1.0)),
    )  # fmt: skip
    d = Diagnosis(("a",), (), "explained", (), cast(Any, fitted), calibration_findings=(off(),))
    statuses = {c["parameter"]: c["beyond_tolerance"] for c in diagnosis_document(d)["calibration"]}
    # ln 0.85 = -0.163 is the edge below, ln 1.15 = 0.140 the one above.
    assert statuses == {
        "T_g": "not_surely",
        "J_roll": "surely",
        "J_pitch": "no",
        "J_yaw": "not_surely",
    }
    assert {c["tolerance"] for c in diagnosis_document(d)["calibration"]} == {0.15}


def test_no_plan_separates_inertias_from_a_thrust_gain() -> None:
    tied = Diagnosis(("a",), (), "ambiguous", (), calibration_findings=(off("motor.thrust_gain"),))
    assert diagnosis_document(tied)["next_experiment"] is None
