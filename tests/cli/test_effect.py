"""``effect``: writes a package with a formula or to begin with, lists and checks effects."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from heli3dof.model.effects import effects
from tests.cli.running import heli3dof
from tests.effect_files.test_from_diagnosis import DIAGNOSIS, write

FOLDER = "heli3dof-torque-voltage-front-times-voltage-back-on-pitch"


def test_effect_new_writes_a_package_that_registers_the_effect(tmp_path: Path) -> None:
    source = write(tmp_path / "d.json", DIAGNOSIS)
    result = heli3dof("effect", "new", "--from", source, "-o", tmp_path, "--json")
    assert result.code == 0, result.err
    (written,) = result.document["written"]
    assert written["effect"] == "torque.voltage_front_times_voltage_back_on_pitch.pitch"
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


def test_effect_new_writes_an_effect_to_begin_with(tmp_path: Path) -> None:
    result = heli3dof("effect", "new", "magnet.detent", "-o", tmp_path, "--json")
    assert result.code == 0, result.err
    (written,) = result.document["written"]
    folder = tmp_path / "heli3dof-magnet-detent"
    assert {Path(f) for f in written["files"]} == set(folder.iterdir())
    to_edit = [f for f in folder.iterdir() if "**" in f.read_text(encoding="utf-8")]
    assert len(to_edit) == 3
    for file in to_edit:  # both equations and the test
        assert str(file) in result.err
    assert heli3dof("effect", "check", folder / "heli3dof_magnet_detent.py").code == 0


@pytest.mark.parametrize(
    "given", [(), ("magnet", "--from", "d.json"), ("Magnet",), ("motor.lag",), ("drag.yaw",)]
)
def test_effect_new_needs_a_free_name_or_a_diagnosis(given: tuple[str, ...]) -> None:
    result = heli3dof("effect", "new", *given)
    assert result.code == 2
    assert "Try: " in result.err


def test_effect_list_has_a_line_per_effect_with_units() -> None:
    result = heli3dof("effect", "list", "--json")
    assert [e["effect"] for e in result.document["effects"]] == list(effects())
    lines = result.err.splitlines()
    assert "friction.coulomb on roll, pitch, yaw: torque_Nm (N·m)" in lines
    assert len(lines) == len(effects()) + 1  # and where the equations are


def test_effect_check_names_the_mistake_and_fails(tmp_path: Path) -> None:
    heli3dof("effect", "new", "magnet", "-o", tmp_path)
    file = tmp_path / "heli3dof-magnet" / "heli3dof_magnet.py"
    code = file.read_text(encoding="utf-8")
    file.write_text(code.replace('"N·m·s³/rad³"', '"N·m·s/rad"'), encoding="utf-8")
    result = heli3dof("effect", "check", file, "--json")
    assert result.code == 6
    (problem,) = result.document["problems"]
    assert "N·m·s/rad" in problem


def test_effect_check_takes_an_installed_effect() -> None:
    assert heli3dof("effect", "check", "friction.coulomb").code == 0
    assert heli3dof("effect", "check", "friction.coulom").code == 2
