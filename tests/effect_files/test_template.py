"""An effect to begin with: its files run, on the side of the models and of the emulated rig."""

from __future__ import annotations

import runpy
import sys
import tomllib
from pathlib import Path

import pytest
from heli3dof_drivers.emulator import effects as emulated

from heli3dof.effect_files.check import problems
from heli3dof.effect_files.template import template_files
from heli3dof.experiment.plan import named_plans
from heli3dof.model import effects


def test_both_sides_of_the_template_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for file, text in template_files("magnet.detent").items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    tests = runpy.run_path(str(tmp_path / "test_heli3dof_magnet_detent.py"))
    tests["test_the_torque_is_that_of_the_equation"]()
    effect = sys.modules["heli3dof_magnet_detent"].EFFECT
    assert effect.name == "magnet.detent"
    assert problems(effect, named_plans()) == []
    (other,) = runpy.run_path(str(tmp_path / "heli3dof_magnet_detent_emulated.py"))["EFFECTS"]
    assert other.name == effect.name
    assert [p.name for p in other.parameters] == [p.name for p in effect.parameters]
    assert all(function.address for function in other.kernels.values())
    project = tomllib.loads((tmp_path / "pyproject.toml").read_text(encoding="utf-8"))
    groups = project["project"]["entry-points"]
    assert groups.keys() == {effects.GROUP, emulated.GROUP}
