"""``plot`` draws a flight; ``info`` gives the numbers of its steps."""

from __future__ import annotations

from pathlib import Path

import pytest
from heli3dof_recordings import references

from heli3dof.comparison.metrics import flight_metrics
from heli3dof.recording.load import load
from tests.cli.running import heli3dof

ROLL, YAW = (r.path for r in references() if r.use == "compare")


@pytest.mark.parametrize(
    ("ending", "start"), [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")]
)
def test_a_flight_is_drawn_in_each_format_and_not_overwritten(
    ending: str, start: bytes, tmp_path: Path
) -> None:
    path = tmp_path / f"flight.{ending}"
    result = heli3dof("plot", ROLL, "-o", path, "--json")
    assert result.code == 0, result.err
    assert result.document == {"schema": "heli3dof.plot/1", "figures": [str(path)]}
    assert path.read_bytes().startswith(start)
    assert heli3dof("plot", ROLL, "-o", path).code == 2


def test_several_flights_have_a_figure_each(tmp_path: Path) -> None:
    result = heli3dof("plot", ROLL, YAW, "-o", tmp_path / "f.svg", "--json")
    names = [Path(f).name for f in result.document["figures"]]
    assert names == ["f-step-roll-10.svg", "f-step-yaw-20.svg"]
    assert all((tmp_path / name).exists() for name in names)


def test_another_format_is_refused_before_the_recording_is_read(tmp_path: Path) -> None:
    result = heli3dof("plot", tmp_path / "missing.mcap", "-o", tmp_path / "flight.gif")
    assert result.code == 2
    assert "flight.pdf" in result.err
    assert heli3dof("plot", tmp_path / "missing.mcap").code == 5


def test_info_has_the_metrics_of_every_step() -> None:
    result = heli3dof("info", YAW, "--json")
    (hold, step) = result.document["steps"]["yaw"]
    assert hold["kind"] == "hold"
    expected = flight_metrics(load(YAW))["yaw"].reported
    for name in ("overshoot_deg", "rise_time_s", "steady_error_deg", "set_deg"):
        assert step[name] == pytest.approx(getattr(expected, name))
    text = heli3dof("info", YAW).out
    assert "0 → 20° at 5 s" in text
    assert f"{expected.rise_time_s:.2f}" in text
    assert "channels" not in text
    assert "channels" in heli3dof("info", YAW, "--verbose").out
