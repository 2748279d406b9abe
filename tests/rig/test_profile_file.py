"""A written profile reads back unchanged, and an edited one keeps its comments."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest

import heli3dof as h3
from heli3dof.errors import UsageError
from heli3dof.rig.profile import TABLE_I, Profile, default_profile, profile_from_dict
from heli3dof.rig.profile_file import HOVER_REMARK, Change, changed_text, new_text, settings
from heli3dof.toml_file import keys


def test_a_new_file_holds_the_numbers_and_names_every_key() -> None:
    text = new_text(TABLE_I)
    assert profile_from_dict(tomllib.loads(text)) == default_profile()
    for name, _ in keys(Profile):
        assert f"{name.rpartition('.')[2]} =" in text, name


def test_a_gain_and_measured_inertias_survive_the_file() -> None:
    gain = [[float(i + j) for j in range(8)] for i in range(2)]
    data = {**TABLE_I, "controller": {"K": gain}, "inertia": {"yaw": 1.1}}
    assert profile_from_dict(tomllib.loads(new_text(data))) == profile_from_dict(data)


def test_uncommenting_every_default_changes_nothing() -> None:
    lines = new_text(TABLE_I).splitlines()
    defaults = [
        line.removeprefix("# ")
        if line.startswith(("# ]", "#     ["))
        or (line.startswith("# ") and line[2:].split(" ")[1:2] == ["="])
        else line
        for line in lines
        if line.removeprefix("# ") not in ("roll =", "pitch =", "yaw =")
    ]
    assert len([line for line in defaults if not line.startswith("#")]) > len(TABLE_I) + 20
    assert profile_from_dict(tomllib.loads("\n".join(defaults))) == default_profile()


def test_a_change_keeps_comments_and_adds_its_own() -> None:
    text = "# my rig\n[motor]\nK_f = 0.12   # from the data sheet\nv_max = 24.0   # the supply\n"
    changed = changed_text(
        text,
        [
            Change("motor.K_f", 0.1, 0.12, "± 0.004, from model.json; was 0.12"),
            Change("inertia.yaw", 1.1, 0.95, "± 0.03, from model.json; was 0.95"),
        ],
    )
    assert "# my rig" in changed
    assert "v_max = 24.0   # the supply" in changed
    assert "K_f = 0.1 # ± 0.004, from model.json; was 0.12" in changed
    assert tomllib.loads(changed)["inertia"] == {"yaw": 1.1}


def test_a_changed_hover_voltage_is_no_longer_marked_as_computed() -> None:
    text = new_text(TABLE_I, {"motor.V_o": HOVER_REMARK})
    other, V_o = Change("motor.K_f", 0.1, 0.12, "measured"), Change("motor.V_o", 7, 8, "measured")
    assert HOVER_REMARK in changed_text(text, [other])
    assert HOVER_REMARK not in changed_text(text, [other, V_o])


@pytest.mark.parametrize(
    ("word", "value"), [("a=.25", 0.25), ("a=-8192", -8192), ("a=lab 2", "lab 2")]
)
def test_a_setting_is_toml_or_plain_text(word: str, value: object) -> None:
    assert settings([word]) == {"a": value}


def test_a_setting_without_a_value_is_refused() -> None:
    with pytest.raises(UsageError, match="KEY=VALUE"):
        settings(["geometry.L_a"])


@pytest.mark.parametrize("changed", [{}, {"controller": None}, {"name": 'a "b"'}])
def test_a_profile_is_saved_and_loaded_from_python(tmp_path: Path, changed: dict[str, Any]) -> None:
    data = {**h3.default_profile().to_dict(), **changed}
    data = {k: v for k, v in data.items() if v is not None}
    data["motor"]["K_f"] = 0.12
    profile = h3.profile_from_dict(data)
    path = h3.save_profile(profile, tmp_path / "rig.toml")
    assert h3.load_profile(path) == profile
    with pytest.raises(h3.OutputExists):
        h3.save_profile(profile, path)
