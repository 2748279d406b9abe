"""A stand-in loses its size when fitted with the unmodelled effect; a true cause keeps it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from heli3dof.diagnosis.conclusion.stand_ins import (
    WithResidual,
    insignificant,
    marked_unsure,
    sizes_with_residual,
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


def test_a_stand_in_loses_its_size_to_the_true_effect() -> None:
    # By hand: A⁻¹ = [100, −80; −80, 100]/3600, so δ = −80 u/3600 = −1 with u = 45.
    (b,) = sizes_with_residual(fit(1.0), nuisance(80.0, 45.0))
    assert b.size_with_residual == pytest.approx(0.0, abs=1e-12)
    assert pytest.approx(100.0) == b.Z2
    assert b.stands_in


def test_a_cause_keeps_its_size_against_a_torque_of_another_shape() -> None:
    (b,) = sizes_with_residual(fit(1.0), nuisance(5.0, 45.0))
    assert b.size_with_residual == pytest.approx(1 - 5 * 45 / 9975)
    assert not b.stands_in
    assert not b.unsure


def test_an_indistinguishable_cause_is_only_unsure() -> None:
    # Almost the same trace, but the residual torque's own score is zero.
    (b,) = sizes_with_residual(fit(1.0), nuisance(95.0, 0.0))
    assert not b.stands_in
    assert b.unsure


def test_a_cause_that_changes_sign_is_a_stand_in() -> None:
    assert WithResidual("x", 1.0, 100.0, -1.0, 20.0).stands_in


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
