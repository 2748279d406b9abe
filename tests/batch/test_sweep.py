"""Sweeps over emulated rigs."""

from __future__ import annotations

from pathlib import Path

import pytest

from heli3dof.batch.sweep import flights, read_sweep, tasks_of_sweep
from heli3dof.errors import UsageError
from heli3dof.rig.profile import default_profile

GRID = """
plan = "rich"
device = "mock:?speed=max&spread=0.05"
[vary]
"hide.friction.coulomb.yaw" = [0, 0.02]
noise = [1, 3]
"""


@pytest.fixture
def sweep(tmp_path: Path):
    def write(text: str) -> Path:
        path = tmp_path / "sweep.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def test_a_grid_flies_every_combination_with_a_seed_of_its_own(sweep) -> None:
    devices = [device for device, _ in flights(read_sweep(sweep(GRID)))]
    start = "mock:?speed=max&spread=0.05"
    assert devices == [
        f"{start}&seed=0&noise=1&hide=friction.coulomb.yaw:0",
        f"{start}&seed=1&noise=3&hide=friction.coulomb.yaw:0",
        f"{start}&seed=2&noise=1&hide=friction.coulomb.yaw:0.02",
        f"{start}&seed=3&noise=3&hide=friction.coulomb.yaw:0.02",
    ]


def test_a_design_spreads_its_points_evenly(sweep) -> None:
    text = '[design]\npoints = 8\nbetween."hide.motor.lag" = [0.0, 0.8]\n'
    values = sorted(varied["hide.motor.lag"] for _, varied in flights(read_sweep(sweep(text))))
    assert [int(v / 0.1) for v in values] == list(range(8))  # Sobol: one point in each eighth


def test_a_seed_that_is_varied_is_kept(sweep) -> None:
    devices = [
        device for device, _ in flights(read_sweep(sweep("[vary]\nseed = [7, 10000000001]\n")))
    ]
    assert devices == ["mock:?speed=max&seed=7", "mock:?speed=max&seed=10000000001"]


def test_each_flight_is_a_task_with_a_key_of_its_own(sweep) -> None:
    tasks = tasks_of_sweep(sweep(GRID), default_profile().with_controller())
    assert [t.name for t in tasks] == [f"sweep-{n:04d}" for n in range(4)]
    assert len({t.key for t in tasks}) == 4


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('device = "serial:///dev/ttyACM0"', "is not an emulated rig"),
        ("[vary]\nnois = [1]", "nois"),
        ("varied = 3", "did you mean 'vary'"),
        ('[vary]\nnoise = [1]\n[design]\npoints = 2\nbetween.noise = [1, 2]', "stands in"),
        ("[design]\npoints = 0\nbetween.noise = [1, 2]", "points"),
    ],
)  # fmt: skip
def test_a_faulty_sweep_is_explained(sweep, text: str, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        read_sweep(sweep(text))
