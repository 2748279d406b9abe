"""A package with the formula of an unmodelled torque, from a diagnosis or a model."""

from __future__ import annotations

import json
import runpy
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from heli3dof.axes import AXES
from heli3dof.effect_files.from_diagnosis import Formula, package_files, read_formulas
from heli3dof.effect_names import name_mistake
from heli3dof.errors import RecordingError, UsageError
from heli3dof.identification.greybox.thrust_scale import thrust_scale
from heli3dof.model.effects import term
from heli3dof.model.effects.empirical import QUANTITIES
from heli3dof.model.greybox.model import nominal
from heli3dof.model.model_file import save_model
from heli3dof.model.physics import state_layout as at
from heli3dof.model.physics.compiled_effects import address
from heli3dof.rig.profile import default_profile

DIAGNOSIS: dict[str, Any] = {
    "schema": "heli3dof.diagnosis/1",
    "leftover": [
        {"axis": "yaw", "formula": None},
        {
            "axis": "pitch",
            "formula": "c * voltage_front * voltage_back",
            "formula_parameters": {"c": {"value": 0.0006, "std": 2e-5, "unit": "N·m/(V·V)"}},
        },
    ],
}
PRODUCT = Formula("pitch", "voltage_front*voltage_back", 0.0006, 2e-5)
FORMULAS = [PRODUCT, Formula("yaw", "abs(yaw_rate)*yaw_rate", -0.1, 0.01),
            Formula("roll", "sin(yaw)", 0.2, 0.01)]  # fmt: skip


def write(path: Path, document: object) -> Path:
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


def test_a_diagnosis_gives_its_formulas(tmp_path: Path) -> None:
    assert read_formulas(write(tmp_path / "d.json", DIAGNOSIS)) == [PRODUCT]


def test_each_axis_and_product_has_its_own_valid_name() -> None:
    names = [Formula(axis, product, 0.1, 0.0).name for product in QUANTITIES for axis in AXES]
    assert len(set(names)) == len(names)
    assert not any(map(name_mistake, names))


def test_an_extended_model_gives_its_formulas(tmp_path: Path) -> None:
    name = "empirical.sin(yaw).roll"
    model = nominal(
        default_profile(), ("friction.viscous.yaw", name, "empirical.spline(yaw:-1:1).yaw"),
        **{f"{name}.coefficient": 0.2},
    )  # fmt: skip
    (formula,) = read_formulas(save_model(model, tmp_path / "m.json"))
    assert (formula.axis, formula.product) == ("roll", "sin(yaw)")
    assert formula.value == pytest.approx(0.2)


def test_a_model_s_coefficient_is_converted_to_SI_as_in_its_diagnosis(tmp_path: Path) -> None:
    """Gravity torque and inertias of 1/1.4 of nominal mean a thrust gain of 1.4 times nominal."""
    name = "empirical.sin(yaw).roll"
    model = nominal(default_profile(), (name,), **{f"{name}.coefficient": 0.2})
    values = model.values.copy()
    values[:4] /= 1.4
    covariance = np.diag([0.0, 0.0, 0.0, 0.0, 0.01**2])
    model = replace(model, values=values, covariance=covariance)
    (formula,) = read_formulas(save_model(model, tmp_path / "m.json"))
    scale = thrust_scale(model)
    assert formula.value == pytest.approx(0.2 * scale.k)
    assert formula.value == pytest.approx(0.28, rel=0.04)
    assert formula.std == pytest.approx(scale.k * np.hypot(0.01, 0.2 * scale.std))


@pytest.mark.parametrize("formula", FORMULAS, ids=lambda f: f.product)
def test_the_package_contains_the_effect_and_a_test_that_passes(
    formula: Formula, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = package_files(formula, "d.json")
    for name, text in files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    module = next(n for n in files if n.startswith("heli3dof_")).removesuffix(".py")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, module, raising=False)
    tests = runpy.run_path(str(tmp_path / f"test_{module}.py"))
    tests["test_the_torque_is_the_coefficient_times_the_product"]()
    effect = sys.modules[module].EFFECT
    (hook,) = effect.hooks.values()
    assert address(hook)
    assert effect.axes == (formula.axis,)
    assert effect.parameters[0].low < formula.value < effect.parameters[0].high
    s = np.linspace(0.1, 0.9, at.SIZE)
    par = np.zeros(at.PARAMETERS)
    empirical = term(f"empirical.{formula.product}.{formula.axis}")
    par[at.AXIS], par[at.A] = empirical.axis_index, formula.value
    out, expected = np.zeros(3), np.zeros(3)
    hook(s, par, np.zeros(at.MEMORY), out)
    next(iter(empirical.effect.hooks.values()))(s, par, np.zeros(at.MEMORY), expected)
    assert out == pytest.approx(expected)


@pytest.mark.parametrize(
    "text", ["", "[]", '{"schema": "heli3dof.diagnosis/1"}', '{"schema": "heli3dof.model/1"}']
)
def test_a_file_without_a_formula_is_an_error_with_a_command(tmp_path: Path, text: str) -> None:
    (tmp_path / "d.json").write_text(text, encoding="utf-8")
    with pytest.raises(RecordingError, match="no formula") as error:
        read_formulas(tmp_path / "d.json")
    assert "heli3dof diagnose" in str(error.value.fix)


def test_a_missing_file_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no file"):
        read_formulas(tmp_path / "d.json")
