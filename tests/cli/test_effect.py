"""``effect new``: writes a package with the formula of an unmodelled torque."""

from __future__ import annotations

import tomllib
from pathlib import Path

from tests.cli.running import heli3dof
from tests.diagnosis.test_effect_package import DIAGNOSIS, write

FOLDER = "heli3dof-torque-voltage-front-times-voltage-back"


def test_effect_new_writes_a_package_that_registers_the_effect(tmp_path: Path) -> None:
    source = write(tmp_path / "d.json", DIAGNOSIS)
    result = heli3dof("effect", "new", "--from", source, "-o", tmp_path, "--json")
    assert result.code == 0, result.err
    (written,) = result.document["written"]
    assert written["effect"] == "torque.voltage_front_times_voltage_back.pitch"
    project = tomllib.loads((tmp_path / FOLDER / "pyproject.toml").read_text(encoding="utf-8"))
    (entry,) = project["project"]["entry-points"]["heli3dof.effects"].values()
    assert (tmp_path / FOLDER / f"{entry.split(':')[0]}.py").exists()
    assert "pip install" in result.err


def test_effect_new_overwrites_nothing_without_force(tmp_path: Path) -> None:
    source = write(tmp_path / "d.json", DIAGNOSIS)
    call = ("effect", "new", "--from", source, "-o", tmp_path)
    assert heli3dof(*call).code == 0
    again = heli3dof(*call)
    assert again.code == 2
    assert "exists" in again.err
    assert heli3dof(*call, "--force").code == 0


def test_effect_new_explains_a_file_without_a_formula(tmp_path: Path) -> None:
    source = write(tmp_path / "d.json", {"schema": "heli3dof.diagnosis/1", "leftover": []})
    result = heli3dof("effect", "new", "--from", source)
    assert result.code == 5
    assert "no torque of this diagnosis has a formula" in result.err
