"""``heli3dof export`` for viewers and of models."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from scipy.io import loadmat

import heli3dof as h3
from tests.cli.running import heli3dof
from tests.recording.make import write_flight


@pytest.fixture
def flown(tmp_path: Path) -> Path:
    return write_flight(tmp_path / "flight.mcap", 100)


def test_foxglove_gets_the_recording_in_3d_and_a_layout(flown: Path) -> None:
    done = heli3dof("export", flown, "--to", "foxglove", "--json")
    assert done.code == 0
    seen, view = flown.with_name("flight-3d.mcap"), flown.with_name("flight-3d.foxglove.json")
    assert done.document["file"] == str(seen)
    assert done.document["layout"] == str(view)
    assert done.document["samples"] == len(h3.load(seen)) == 100
    assert "configById" in json.loads(view.read_text())
    assert view.name in done.err


def test_a_second_export_overwrites_neither_file(flown: Path) -> None:
    view = flown.with_name("flight-3d.foxglove.json")
    view.write_text("mine")
    assert heli3dof("export", flown, "--to", "foxglove").code == 2
    assert view.read_text() == "mine"
    assert not flown.with_name("flight-3d.mcap").exists()


def test_plotjuggler_gets_a_layout_and_the_command_to_open_it(flown: Path) -> None:
    done = heli3dof("export", flown, "--to", "plotjuggler")
    assert done.code == 0
    assert f"plotjuggler -d {flown} -l {flown.with_suffix('.xml')}" in done.err
    assert flown.with_suffix(".xml").read_text().startswith("<?xml")


def test_a_csv_log_has_no_topics_for_plotjuggler(tmp_path: Path) -> None:
    done = heli3dof("export", tmp_path / "log.csv", "--to", "plotjuggler")
    assert done.code == 2
    assert "heli3dof import" in done.err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--to", "foxglov"), "did you mean 'foxglove'?"),
        (("--to", "csv", "-o", "a.mat"), "--to and -o name different formats"),
    ],
)
def test_a_wrong_format_is_a_usage_error(flown: Path, words: tuple[str, ...], message: str) -> None:
    done = heli3dof("export", flown, *words)
    assert done.code == 2
    assert message in done.err


def test_to_csv_accepts_the_compressed_ending(flown: Path, tmp_path: Path) -> None:
    assert heli3dof("export", flown, "--to", "csv", "-o", tmp_path / "a.csv.gz").code == 0


def test_a_missing_rerun_names_the_command(flown: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    done = heli3dof("export", flown, "--to", "rerun")
    assert done.code == 2
    assert "pip install 'heli3dof[rerun]'" in done.err
    assert not flown.with_suffix(".rrd").exists()


def test_a_model_file_becomes_a_mat_file(tmp_path: Path) -> None:
    h3.save_model(h3.load_model("hover"), tmp_path / "hover.json")
    done = heli3dof("export", tmp_path / "hover.json", "--json")
    assert done.code == 0
    assert done.document["model"] == "hover"
    assert loadmat(tmp_path / "hover.mat")["A"].shape == (6, 6)


def test_a_model_is_no_table(tmp_path: Path) -> None:
    h3.save_model(h3.load_model("hover"), tmp_path / "hover.json")
    done = heli3dof("export", tmp_path / "hover.json", "--to", "csv")
    assert done.code == 2
    assert f"heli3dof export {tmp_path / 'hover.json'}" in done.err
