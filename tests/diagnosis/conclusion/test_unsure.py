"""A cause that imitates a residual torque loses its evidence to it; a true cause keeps it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from heli3dof.diagnosis.conclusion.unsure import (
    MIN_EVIDENCE_SHARE,
    evidence_with_residual,
    insignificant,
    marked_unsure,
    with_resemblance,
)
from heli3dof.diagnosis.result import Finding
from heli3dof.diagnosis.unmodelled.torque_evidence import Nuisance
from heli3dof.diagnosis.unmodelled.unmodelled_torque import ResidualTorque
from heli3dof.diagnosis.validation.gain import Interval
from heli3dof.identification.greybox.estimate import Estimate


def fit(value: float, std: float = 0.1) -> Estimate:
    """A fit of one term with one parameter, absent at zero."""
    free = SimpleNamespace(term="friction.viscous.yaw", null=0.0, log=False, slope=lambda v: 1.0)
    return cast(Any, SimpleNamespace(
        optimum=SimpleNamespace(theta=np.array([value])), values=np.array([value]), free=[free],
        std=np.array([std]),
        structure=SimpleNamespace(terms=[SimpleNamespace(name="friction.viscous.yaw")]),
    ))  # fmt: skip


def nuisance(shared: float, u: float) -> Nuisance:
    """The term and one free-form torque of score u, information 100 each."""
    A = np.array([[100.0, shared], [shared, 100.0]])
    return Nuisance(np.zeros((2, 0)), A, np.array([0.0, u]), np.zeros((0, 2)))


def test_a_cause_loses_its_evidence_to_a_torque_of_its_shape() -> None:
    # By hand: A⁻¹ = [100, −80; −80, 100]/3600, so δ = −80 u/3600 = −1 with u = 45.
    ((alone, held),) = evidence_with_residual(fit(1.0), nuisance(80.0, 45.0)).values()
    assert alone == pytest.approx(100.0)
    assert held == pytest.approx(0.0, abs=1e-12)


def test_a_cause_keeps_its_size_against_a_torque_of_another_shape() -> None:
    ((alone, held),) = evidence_with_residual(fit(1.0), nuisance(5.0, 45.0)).values()
    assert held == pytest.approx((1 - 5 * 45 / 9975) ** 2 / (100 / 9975))
    assert held > MIN_EVIDENCE_SHARE * alone


def test_an_indistinguishable_cause_is_unsure() -> None:
    # Almost the same trace, but the residual torque's own score is zero.
    ((alone, held),) = evidence_with_residual(fit(1.0), nuisance(95.0, 0.0)).values()
    assert held < MIN_EVIDENCE_SHARE * alone


def test_the_residual_torque_names_what_it_replaces_unless_it_resembles_another() -> None:
    residual = ResidualTorque("yaw", "pitch_rate", 0.5, (), (), 100.0, 1.0)
    (named,) = with_resemblance([residual], ["drag.quadratic.yaw"])
    assert named.like == "drag.quadratic.yaw-like"
    already = replace(residual, like="friction.viscous.yaw-like")
    assert with_resemblance([already], ["drag.quadratic.yaw"]) == (already,)
    assert with_resemblance([residual], []) == (residual,)


def test_an_unconfirmed_or_weak_finding_is_marked_as_like() -> None:
    def finding(low: float, weak: bool = False) -> Any:
        return Finding(
            cast(Any, SimpleNamespace(term=SimpleNamespace(name="motor.delay"), weak=weak)), {},
            cast(Any, SimpleNamespace(log_likelihood=Interval(28.0, low, 71.0))), np.zeros(4),
        )  # fmt: skip

    results = marked_unsure(
        [finding(-8.0), finding(3.0), finding(3.0, weak=True)], fit(1.0), [], nuisance(0.0, 0.0)
    )
    assert [f.like for f in results] == [True, False, True]


def test_a_size_compatible_with_zero_is_insignificant() -> None:
    assert insignificant(fit(1.0, 0.6)) == {"friction.viscous.yaw"}  # 1.7 standard deviations
    assert insignificant(fit(-1.0, 0.4)) == set()  # 2.5
