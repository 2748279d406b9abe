"""The check of an effect: every effect of heli3dof passes, each kind of mistake is named."""

from __future__ import annotations

import doctest
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from heli3dof.effect_files import check
from heli3dof.effect_files.check import effect_of_file, problems, unit_problems
from heli3dof.effect_files.template import template_files
from heli3dof.errors import RecordingError, UsageError
from heli3dof.experiment.plan import named_plans
from heli3dof.model.effects import Effect, Parameter, Stage, effects

NUMBER = Parameter("torque_Nm", "N·m", 0.0, -1.0, 1.0, 0.1, "its size")


def constant(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[1] += par[1]


def with_offset(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[1] += par[1] + 0.1


def nothing(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[1] += 0.0 * par[1]


def infinite(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[1] += par[1] / par[2]


def unknown(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[1] += par.no_such_thing


def root(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[1] += par[1] * s[3] ** 0.5


def far_yaw(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[1] += par[1] * (6.0 - s[3]) ** 0.5


def at_rest(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[1] += par[1] * s[4] / abs(s[4])


def replaced(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[1] = par[1] * s[3]


def outside(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[3] += par[1]


def negative_index(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[-2] += par[1]


def changes_the_state(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[1] += par[1]
    s[2] = 0.0


def other_axis(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[1] += par[1] * s[3]
    out[2] += par[1]


SOUND = Effect("mine", "A torque.", (NUMBER,), {Stage.TORQUE: constant}, axes=("pitch",))


def test_the_doctests_pass() -> None:
    assert doctest.testmod(check).failed == 0


@pytest.mark.parametrize("name", effects())
def test_every_effect_of_heli3dof_is_in_order(name: str) -> None:
    assert problems(effects()[name], named_plans()) == []


@pytest.mark.parametrize(
    ("hook", "mistake"),
    [
        (with_offset, "adds a torque although each parameter has its null"),
        (nothing, "adds nothing at typical parameters"),
        (infinite, "not finite"),
        (root, "not finite"),
        (far_yaw, "not finite"),
        (at_rest, "not finite"),
        (replaced, "replaces out"),
        (outside, "index 3 is outside"),
        (negative_index, "index -2 is outside"),
        (changes_the_state, "read-only"),
        (other_axis, "the equation of pitch changes yaw"),
        (unknown, "does not compile"),
    ],
)
def test_a_mistake_in_the_equation_is_named(hook: Any, mistake: str) -> None:
    assert problems(SOUND, named_plans()) == []
    found = problems(replace(SOUND, hooks={Stage.TORQUE: hook}), named_plans())
    assert any(mistake in f for f in found), found


def test_the_memory_is_kept_from_call_to_call() -> None:
    def second_call(s: Any, par: Any, mem: Any, out: Any) -> None:
        out[1] += par[1] * mem[0]
        mem[0] = 1.0

    assert problems(replace(SOUND, hooks={Stage.TORQUE: second_call}), named_plans()) == []


def test_the_name_of_an_effect_of_heli3dof_is_refused() -> None:
    found = problems(replace(SOUND, name="friction.coulomb"), named_plans())
    assert found == [
        "name: heli3dof has an effect 'friction.coulomb' already; choose another name."
    ]


def test_a_file_can_be_checked_again_without_a_change(tmp_path: Path) -> None:
    file = tmp_path / "mine.py"
    file.write_text(template_files("mine")["heli3dof_mine.py"], encoding="utf-8")
    # Another process, in which numba may write its cache
    subprocess.run([sys.executable, "-m", "heli3dof", "effect", "check", file], check=True)
    assert problems(effect_of_file(file), named_plans()) == []


@pytest.mark.parametrize(
    "name", ["My Effect!", "drag.yaw", "drag.quadratic.travel", "empirical.yaw_rate"]
)
def test_a_name_that_is_no_effect_s_is_refused(name: str) -> None:
    (found,) = problems(replace(SOUND, name=name), named_plans())
    assert found.startswith("name: ")


def test_unknown_names_are_named() -> None:
    wrong = replace(
        SOUND, confused_with=("motor.lags",), separated_by="x", within="friction.coulomb",
        requires="motor.lags",
    )  # fmt: skip
    found = problems(wrong, ("rich",))
    assert [f.split(":")[0] for f in found] == [
        "confused_with", "within", "requires", "separated_by"
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("name", "unit", "mistakes"),
    [
        ("torque_Nm", "N·m", 0),
        ("damping_Nms_per_rad", "N·m·s/rad", 0),
        ("share", "–", 0),
        ("drag_Nms5_per_rad5", "N·m·s⁵/rad⁵", 0),
        ("drag_Nms12_per_rad12", "N·m·s¹²/rad¹²", 0),
        ("coefficient", "N·m·s⁻¹", 0),
        ("drag_Nms5_per_rad5", "N·m·s⁶/rad⁵", 1),
        ("coefficient", "N·m/(V·V)", 0),
        ("torque_Nm", "N·m·s/rad", 1),
        ("torque", "Nm", 1),
        ("angle", "furlong", 1),
    ],
)
def test_units_are_products_of_known_ones_and_agree_with_the_name(
    name: str, unit: str, mistakes: int
) -> None:
    assert len(list(unit_problems(replace(NUMBER, name=name, unit=unit)))) == mistakes


def test_a_file_without_an_effect_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "mine.py"
    with pytest.raises(UsageError, match="no file"):
        effect_of_file(file)
    for code, why in (("x = 1", "has no EFFECT"), ("1 / 0", "ZeroDivisionError")):
        file.write_text(code, encoding="utf-8")
        with pytest.raises(RecordingError, match=why):
            effect_of_file(file)
