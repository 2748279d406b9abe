"""Causes that are not confirmed are marked "…-like"."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from heli3dof.diagnosis.conclusion.unconfirmed import (
    insignificant,
    marked_unconfirmed,
    with_resemblance,
)
from heli3dof.diagnosis.result import Finding
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


def replaced(name: str, *tied_with: str) -> Finding:
    """A cause that a torque replaces, with the causes confounded with it."""
    choice = SimpleNamespace(term=SimpleNamespace(name=name), tied_with=tied_with)
    return Finding(cast(Any, choice), {}, cast(Any, None), np.zeros(4))


def test_a_residual_torque_is_like_the_causes_that_it_replaces_unless_it_resembles_another() -> (
    None
):
    residual = ResidualTorque("yaw", "voltage_sum", 0.5, (), (), 100.0, 1.0)
    (alone,) = with_resemblance([residual], [replaced("drag.quadratic.yaw")])
    assert alone.resembles == "drag.quadratic.yaw-like"
    offset = replaced("encoder.offset.pitch", "aero.reaction_torque")
    (either,) = with_resemblance([residual], [offset])
    assert either.resembles == "encoder.offset.pitch-like or aero.reaction_torque-like"
    already = replace(residual, resembles="friction.viscous.yaw-like")
    assert with_resemblance([already], [offset]) == (already,)
    assert with_resemblance([residual], []) == (residual,)


def test_an_unconfirmed_finding_is_marked_as_like() -> None:
    def finding(low: float) -> Any:
        return Finding(
            cast(Any, SimpleNamespace(term=SimpleNamespace(name="motor.delay"))), {},
            cast(Any, SimpleNamespace(log_likelihood=Interval(28.0, low, 71.0))), np.zeros(4),
        )  # fmt: skip

    results = marked_unconfirmed([finding(-8.0), finding(3.0)], fit(1.0))
    assert [f.unconfirmed for f in results] == [True, False]


def test_a_size_compatible_with_zero_is_insignificant() -> None:
    assert insignificant(fit(1.0, 0.6)) == {"friction.viscous.yaw"}  # 1.7 standard deviations
    assert insignificant(fit(-1.0, 0.4)) == set()  # 2.5
