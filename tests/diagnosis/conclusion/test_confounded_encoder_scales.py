"""Causes confounded with a wrong encoder scale."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any, cast

import pytest

from heli3dof.diagnosis.base_parameters import BaseParameter, OffNominal
from heli3dof.diagnosis.conclusion.confounded_encoder_scales import (
    undetectable_scales,
    with_scale_ties,
)
from heli3dof.diagnosis.result import Finding
from heli3dof.diagnosis.search.select import Choice
from heli3dof.model.effects import term

REST = math.radians(-27.5)
E = 0.15


def numbers(roll: float = 1.0, pitch: float = 1.0, yaw: float = 1.0) -> list[BaseParameter]:
    """Inertias over nominal, each known to 1 %; T_g = 1.17 N·m."""
    T_g = BaseParameter(1.17, 1.17, 0.01, "T_g", "N·m", 0.01)
    return [
        T_g,
        *(
            BaseParameter(1.0, ratio, 0.01, f"J_{axis}", "kg·m²", 0.01)
            for axis, ratio in (("roll", roll), ("pitch", pitch), ("yaw", yaw))
        ),
    ]


def off(name: str, ratio: float) -> OffNominal:
    return OffNominal(term(name), ratio, 0.02, 100.0, 1.0)


def finding(name: str, value: float) -> Finding:
    choice = Choice(term(name), 100.0, 1.0, ("bias.torque.yaw",), ())
    (p, *_) = choice.term.effect.parameters
    return Finding(choice, {p.name: (value, 0.1)}, cast(Any, SimpleNamespace()), cast(Any, None))


def tied(
    findings: list[Finding], base: list[OffNominal], seen: list[BaseParameter]
) -> tuple[list[tuple[str, ...]], list[tuple[str, ...]]]:
    a, b = with_scale_ties(findings, base, seen, rest_rad=REST, tolerance=E)
    return [f.tied_with for f in a], [o.tied_with for o in b]


def test_a_yaw_inertia_is_confounded_with_the_yaw_encoder_scale() -> None:
    assert tied([], [off("inertia.yaw", 1.5)], numbers(yaw=1.5))[1] == [("encoder.scale.yaw",)]


def test_a_pitch_inertia_alone_is_not_confounded_with_the_pitch_encoder_scale() -> None:
    assert tied([], [off("inertia.pitch", 1.5)], numbers(pitch=1.5))[1] == [()]


def test_opposite_pitch_and_yaw_inertias_are_confounded_with_the_pitch_encoder_scale() -> None:
    # k = 1.25: J_pitch/1.25 and J_yaw · 1.25.
    base = [off("inertia.pitch", 0.8), off("inertia.yaw", 1.25)]
    pitch, yaw = tied([], base, numbers(pitch=0.8, yaw=1.25))[1]
    assert pitch == ("encoder.scale.pitch",)
    assert set(yaw) == {"encoder.scale.pitch", "encoder.scale.yaw"}


def test_a_small_roll_offset_is_confounded_with_the_roll_encoder_scale() -> None:
    # 27.5° (1 − 1/k) = 2.95° for k = 1.12, within the tolerance of J_roll.
    assert tied([finding("encoder.offset.roll", 2.95)], [], numbers())[0] == [
        ("bias.torque.yaw", "encoder.scale.roll")
    ]
    # 15° would be k = 2.2, and J_roll less than half of what it is.
    assert tied([finding("encoder.offset.roll", 15.0)], [], numbers())[0] == [("bias.torque.yaw",)]


@pytest.mark.parametrize(("torque", "is_tied"), [(0.06, True), (0.5, False), (2.0, False)])
def test_a_weak_pendulum_is_confounded_with_the_roll_encoder_scale(
    torque: float, is_tied: bool
) -> None:
    (names,), _ = tied([finding("stiffness.pendulum.roll", torque)], [], numbers())
    assert ("encoder.scale.roll" in names) is is_tied


def test_an_encoder_scale_within_the_tolerance_is_not_identifiable() -> None:
    def invisible(
        *axes: str, tied: tuple[str, ...] = (), detectable_offset_deg: float = 2.0
    ) -> list[str]:
        names = undetectable_scales(
            tied, axes, rest_rad=REST, tolerance=E, detectable_offset_deg=detectable_offset_deg
        )
        return [n.removeprefix("encoder.scale.") for n in names]

    axes = ("roll", "pitch", "yaw")
    assert invisible(*axes) == ["pitch", "yaw"]
    assert invisible("yaw") == ["yaw"]
    assert invisible(*axes, tied=("encoder.scale.yaw",)) == [
        "pitch"
    ]  # it is already reported there
    # 27.5° (1 − 1/1.15) = 3.59°: level is off by that where roll counts 15 % too much.
    assert invisible(*axes, detectable_offset_deg=3.5) == ["pitch", "yaw"]
    assert invisible(*axes, detectable_offset_deg=3.7) == ["roll", "pitch", "yaw"]
