"""The verdict is ambiguous if the first finding is confounded, whichever kind it is."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from heli3dof.axes import AXES
from heli3dof.diagnosis.base_parameters import BaseParameter, OffNominal
from heli3dof.diagnosis.conclusion.verdict import (
    conclude,
    remainders,
    verdict_of,
    without_causes,
)
from heli3dof.diagnosis.document import diagnosis_document
from heli3dof.diagnosis.result import (
    Diagnosis,
    Finding,
    Fitted,
    UnexplainedError,
    in_order,
    in_order_of_selection,
)
from heli3dof.diagnosis.search.select import Choice
from heli3dof.diagnosis.validation.gain import Gain, Interval
from heli3dof.identification.profile_update import Measured, ratios
from heli3dof.integrity import Fault, Kind
from heli3dof.model.effects import term, terms
from heli3dof.model.greybox.model import nominal
from heli3dof.rig.profile import default_profile


def off(*tied: str) -> OffNominal:
    return OffNominal(terms(["inertia.roll"])[0], 1.4, 0.03, 60.0, 1.0, tied_with=tied)


def finding(*tied: str) -> Any:
    cause = terms(["motor.lag"])[0]
    choice = Choice(cause, 50.0, 1.0, tied, ())
    return Finding(choice, {}, gained(None), np.zeros(4))


def gained(loglik: float | None) -> Gain:
    won = None if loglik is None else Interval(loglik, loglik, loglik)
    return Gain("holdout", {}, {}, {}, won)


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


@pytest.mark.parametrize(
    ("before", "after", "low", "verdict"),
    [
        (4.1, 0.4, 3.8, "off_calibration"),
        (0.22, 0.21, 0.005, "nothing_found"),  # significant, but most of the error is noise
        (4.1, 0.4, -0.1, "nothing_found"),  # large, but not significant
    ],
)
def test_a_refit_that_removes_most_of_the_error_is_off_calibration(
    before: float, after: float, low: float, verdict: str
) -> None:
    none = dict.fromkeys(("pitch", "yaw"))
    won = Interval(before - after, low, before)
    refit = Gain("", {"roll": before, **none}, {"roll": after, **none}, {"roll": won, **none},
                 None)  # fmt: skip
    assert verdict_of([], [], refit) == verdict


def test_a_fault_of_the_clock_does_not_hide_an_ambiguous_cause() -> None:
    jitter = Fault("timing.jitter", Kind.FINDING, "a", "", "", "", effect="timing.jitter")
    assert verdict_of([jitter, finding("motor.delay")], []) == "ambiguous"
    assert verdict_of([jitter], []) == "explained"


def errors(
    before: tuple[float, ...], after: tuple[float, ...], noise: tuple[float, ...],
    removes_most_error: bool = False,
) -> Any:  # fmt: skip
    """A fit whose errors (roll, pitch, yaw) are ``before`` with the profile's numbers."""
    known = {a: (b, n) for a, b, n in zip(AXES, before, noise, strict=True)}
    return SimpleNamespace(
        simulation_error=SimpleNamespace(at=lambda horizon_s, axis: known[axis]),
        refit=SimpleNamespace(
            before=dict(zip(AXES, before, strict=True)), removes_most_error=removes_most_error
        ),
        gain=SimpleNamespace(after=dict(zip(AXES, after, strict=True))),
    )


UNKNOWN = (math.nan,) * 3


@pytest.mark.parametrize(
    ("before", "after", "noise", "axes"),
    [
        ((1.0, 7.0, 1.0), (1.0, 6.2, 0.9), UNKNOWN, ["pitch", "roll", "yaw"]),
        ((0.2, 7.0, 5.0), (0.2, 4.0, 1.0), UNKNOWN, []),  # 17 of 74 deg² remain
        ((1.0, 7.0, 1.0), (1.0, 6.2, 0.9), (0.9, 5.5, 0.9), []),  # most of it is noise
        ((1.0, 7.0, 1.0), (0.5, 6.2, 0.9), (0.4, 1.0, 0.9), ["pitch"]),
    ],
)
def test_causes_that_leave_most_of_the_error_do_not_explain_it(
    before: tuple[float, ...], after: tuple[float, ...], noise: tuple[float, ...], axes: list[str]
) -> None:
    remaining = remainders(errors(before, after, noise), [finding()])
    assert [r.axis for r in remaining] == axes
    assert verdict_of([finding()], remaining) == ("unexplained" if axes else "explained")
    assert remainders(errors(before, after, noise), []) == ()  # without a cause


def test_refitted_numbers_that_predict_an_axis_worse_do_not_explain_the_error() -> None:
    """The noise floor, 9.8°, cannot be right: without any fit the error is only 2.4°."""
    e = (1.6, 2.4, 0.4), (0.1, 8.3, 0.9), (0.2, 9.8, 0.9)
    remaining = remainders(errors(*e, removes_most_error=True), [])
    assert next((r.axis, r.noise_deg) for r in remaining) == ("pitch", 2.4)


@pytest.mark.parametrize(
    ("after", "worse"),
    [((0.1, 8.3, 0.9), True), ((2.1, 2.4, 0.4), False), ((0.1, 3.7, 0.4), True)],
)
def test_a_model_with_half_as_much_error_again_predicts_worse(
    after: tuple[float, ...], worse: bool
) -> None:
    """Mean squares, summed over the axes: 8.5 before; 69.7, 10.3 and 13.9 deg² after."""
    e = errors((1.6, 2.4, 0.4), after, UNKNOWN)
    assert Fitted.predicts_worse.fget(e) == worse


@pytest.mark.parametrize(("worse", "verdict"), [(True, "nothing_found"), (False, "unexplained")])
def test_a_fit_that_predicts_worse_than_the_profile_shows_nothing(
    worse: bool, verdict: str
) -> None:
    numbers = [
        BaseParameter(1.0, 1.0, 0.1, name, "", 0.1)
        for name in ("T_g", "J_roll", "J_pitch", "J_yaw")
    ]
    fitted: Any = SimpleNamespace(
        model=SimpleNamespace(profile=default_profile()),
        calibration=numbers, refit=None, predicts_worse=worse,
    )  # fmt: skip
    torque: Any = SimpleNamespace(axis="roll")
    d = conclude(
        Diagnosis(("a",), (), "", (), fitted, (finding(),), (off(),), residual_torques=(torque,)),
        AXES,
    )
    assert d.verdict == verdict
    assert bool(d.findings or d.calibration_findings or d.residual_torques) != worse


def test_a_cause_that_is_not_confirmed_explains_nothing_for_certain() -> None:
    assert verdict_of([replace(finding(), unconfirmed=True)], ()) == "ambiguous"


def test_slow_noise_is_no_unexplained_error() -> None:
    draught: Any = SimpleNamespace(axis="pitch")
    left = errors((1.0, 7.0, 1.0), (0.3, 6.2, 0.3), UNKNOWN)
    assert remainders(left, [finding()], [draught]) == ()
    floor = errors((1.0, 7.0, 1.0), (0.3, 6.2, 0.3), (0.3, 1.0, 0.3))  # which contains slow noise
    assert [r.axis for r in remainders(floor, [finding()], [draught])] == ["pitch"]


def test_an_unexplained_error_is_left_over_and_depends_on_nothing() -> None:
    rest = UnexplainedError("pitch", 7.0, 6.2, None)
    d = Diagnosis(("a",), (), "unexplained", (), remainders=(rest,))
    (left,) = diagnosis_document(d)["leftover"]
    assert (left["axis"], left["depends_on"], left["table"]) == ("pitch", None, [])
    assert left["error_deg"] == {"simulation": 7.0, "extended_model": 6.2, "noise_floor": None}


def test_ratios_to_the_thrust_gain_have_no_prior_in_them() -> None:
    """K_f known to 4 %, J_yaw to 5 %: their ratio to 3 %."""
    p = default_profile()
    J = dict(zip(("J_roll", "J_pitch", "J_yaw"), p.inertias, strict=True))
    base = {"K_f": Measured(p.motor.K_f, p.motor.K_f, 0.04 * p.motor.K_f)}
    base |= {n: Measured(v, v, 0.05 * v) for n, v in J.items()}
    found = ratios(base, p, None)
    assert found["K_f/J_yaw"].std / found["K_f/J_yaw"].value == pytest.approx(0.03)


def test_findings_are_ordered_by_their_gain_and_off_nominal_parameters_by_score() -> None:
    lag, inertia = finding(), off()
    late = replace(lag, choice=replace(lag.choice, score=70.0))
    assert in_order([], [lag, late], [inertia]) == (inertia, lag, late)
    assert in_order([], [late, lag], [inertia]) == (late, inertia, lag)
    gaps = Fault("timing.gaps", Kind.FINDING, "a", "", "", "", effect="timing.gaps")
    assert in_order([gaps], [lag], []) == (lag, gaps)


def test_the_document_has_the_finding_with_the_largest_gain_first() -> None:
    """Forward selection may find the stronger cause second: the first one hides it."""
    first = replace(finding(), gain=gained(227.7))
    delay = replace(first.choice, term=terms(["motor.delay"])[0], score=10.0)
    second = Finding(delay, {}, gained(360.9), np.zeros(4))
    d = Diagnosis(("a",), (), "explained", (), findings=(first, second))
    found = diagnosis_document(d)["findings"]
    assert [f["effect"] for f in found] == ["motor.delay", "motor.lag"]


def test_a_stronger_second_cause_does_not_hide_that_the_first_is_confounded() -> None:
    first = replace(finding("motor.delay"), gain=gained(86.0))
    pendulum = replace(first.choice, term=terms(["stiffness.pendulum.roll"])[0], tied_with=())
    second = Finding(pendulum, {}, gained(117.0), np.zeros(4))
    assert in_order([], [first, second], []) == (second, first)
    assert verdict_of(in_order_of_selection([], [first, second], []), []) == "ambiguous"


def test_a_confounded_base_parameter_requests_the_plan_that_separates_it() -> None:
    tied = Diagnosis(("a",), (), "ambiguous", (), calibration_findings=(off("motor.thrust_curve"),))
    plan = diagnosis_document(tied)["next_experiment"]
    assert plan["plan"] == terms(["inertia.roll"])[0].effect.separated_by
    assert plan["separates"] == ["inertia.roll", "motor.thrust_curve"]
    assert "catalogue's plan for inertia.roll" in plan["why"]
    assert "did not compare plans in simulation" in plan["why"]


def test_beyond_tolerance_has_three_values() -> None:
    numbers = tuple(
        BaseParameter(1.0, value, 0.03, name, "kg·m²", 0.03)
        for name, value in (
            ("K_f", 1.0),
            ("T_g", 0.79),
            ("J_roll", 1.4),
            ("J_pitch", 1.12),
            ("J_yaw", 0.83),
        )
    )
    model = nominal(default_profile())
    gain = SimpleNamespace(before={}, after={}, log_likelihood=None, rmse_deg={}, on="holdout")
    fitted = SimpleNamespace(refit=None, refit_with_causes=None,
        final=None, open=None, model=model, calibration=numbers, gain=gain, noise_floor={},
        simulation_error=SimpleNamespace(horizons_s=(), worst=(), at=lambda h, axis: (1.0, 1.0)),
    )  # fmt: skip
    d = Diagnosis(("a",), (), "explained", (), cast(Any, fitted), calibration_findings=(off(),))
    statuses = {c["parameter"]: c["beyond_tolerance"] for c in diagnosis_document(d)["calibration"]}
    # ln 0.85 = -0.163 is the edge below, ln 1.15 = 0.140 the one above.
    assert statuses == {
        "K_f": "no",
        "T_g": "not_surely",
        "J_roll": "surely",
        "J_pitch": "no",
        "J_yaw": "not_surely",
    }
    assert {c["tolerance"] for c in diagnosis_document(d)["calibration"]} == {0.15}


def test_a_log_without_a_likelihood_has_the_keys_of_the_profile_too() -> None:
    """K_f 1.2 times, T_g 1.5 times nominal: in units of K_f, T_g and V_o are 1.25 times nominal."""
    profile = default_profile()
    values = {"K_f": 1.2 * profile.motor.K_f, "T_g": 1.5 * profile.trim_torque}
    values |= dict(zip(("J_roll", "J_pitch", "J_yaw"), profile.inertias, strict=True))
    numbers = tuple(BaseParameter(1.0, v, 0.03 * v, n, "", 0.03) for n, v in values.items())
    fitted = SimpleNamespace(
        refit=None, refit_with_causes=None, final=None, open=None,
        model=nominal(profile, T_g=1.25 * profile.trim_torque),
        gain=SimpleNamespace(before={}, after={}, log_likelihood=None, rmse_deg={}, on=""),
        calibration=numbers, noise_floor={},
        simulation_error=SimpleNamespace(horizons_s=(), worst=(), at=lambda h, axis: (1.0, 1.0)),
    )  # fmt: skip
    document = diagnosis_document(Diagnosis(("a",), (), "explained", (), cast(Any, fitted)))
    keys = {k["key"]: k["value"] for k in document["profile"]}
    assert keys["motor.V_o"] == pytest.approx(1.25 * profile.motor.V_o)
    assert {r["ratio"] for r in document["ratios"]} >= {"V_o"}


def test_no_plan_separates_inertias_from_a_thrust_gain() -> None:
    tied = Diagnosis(("a",), (), "ambiguous", (), calibration_findings=(off("motor.thrust_gain"),))
    assert diagnosis_document(tied)["next_experiment"] is None


def test_a_named_cause_is_identifiable() -> None:
    none = cast(Any, None)
    drag = Choice(term("drag.quadratic.roll"), 1144.0, 1.0, ("friction.viscous.roll",), ())
    causes = [
        Finding(drag, {}, none, none), OffNominal(term("inertia.pitch"), 1.4, 0.05, 64.0, 1.0),
    ]  # fmt: skip
    names = ["drag.quadratic.roll", "friction.viscous.roll", "inertia.pitch", "encoder.scale.yaw"]
    assert without_causes(names, causes) == ("friction.viscous.roll", "encoder.scale.yaw")
