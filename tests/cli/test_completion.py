"""What the shell's completion offers: plans, devices, models, effects, files."""

from __future__ import annotations

from pathlib import Path

import pytest

from heli3dof.cli import completion


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("a.mcap", "b.csv", "c.json", "my.toml", ".hidden.mcap", "d.txt"):
        (tmp_path / name).touch()
    (tmp_path / "flights").mkdir()
    (tmp_path / "flights" / "e.mcap").touch()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_recordings_are_files_of_their_kinds_and_folders(folder: Path) -> None:
    assert completion.recordings("") == ["a.mcap", "b.csv", "flights/"]
    assert completion.recordings("flights/") == ["flights/e.mcap"]
    assert completion.recordings(f"{folder}/a") == [f"{folder}/a.mcap"]


def test_a_folder_that_does_not_exist_offers_nothing(folder: Path) -> None:
    assert completion.recordings("missing/x") == []


def test_plans_and_models_are_names_and_files(folder: Path) -> None:
    assert completion.plans("m") == ["multisine", "my.toml"]
    assert completion.models("")[-2:] == ["c.json", "flights/"]
    assert completion.recordings_and_models("ho") == ["hover", "hover-printed"]


def test_devices_are_the_drivers_schemes() -> None:
    assert {"mock:", "serial:", "usb:"} <= set(completion.devices(""))
    assert completion.devices("mo") == ["mock:"]


def test_the_last_of_several_effects_is_completed() -> None:
    offered = completion.terms("+aero.inflow,-friction.c")
    assert offered == [
        f"+aero.inflow,-friction.coulomb.{axis}" for axis in ("pitch", "roll", "yaw")
    ]
