"""``mock:?exercise=FILE``: the sealed rig flies like the open one and states nothing."""

from __future__ import annotations

from pathlib import Path

import pytest

from heli3dof.errors import UsageError
from heli3dof.rig.drivers import open_driver
from heli3dof.rig.interface import Command
from heli3dof.rig.profile import default_profile
from heli3dof.rig.sealed_rig import hidden_rig
from tests.exercise.making import EXERCISE, KEY, exercise_that, written


def counts(url: str, periods: int = 300) -> tuple[int, ...]:
    rig = open_driver(url, default_profile())
    rig.arm()
    for k in range(periods):
        sample = rig.exchange(Command(k + 1, 9.0, 7.0), 0.0)
    rig.close()
    return sample.counts


def test_a_sealed_rig_moves_like_the_open_one(tmp_path: Path) -> None:
    hide = hidden_rig(EXERCISE).hide
    sealed = counts(f"mock:?speed=max&seed=3&exercise={written(tmp_path, EXERCISE)}")
    assert sealed == counts(f"mock:?speed=max&seed=3&hide={hide}")
    assert sealed != counts("mock:?speed=max&seed=3")


def test_the_seed_of_the_url_changes_the_noise_and_not_the_rig(tmp_path: Path) -> None:
    path = written(tmp_path, exercise_that(KEY, 5, count=0))
    bodies, motions = set(), set()
    for seed in (1, 2):
        rig = open_driver(f"mock:?speed=max&seed={seed}&exercise={path}", default_profile())
        bodies.add(rig.device.plant.truth.body)  # type: ignore[attr-defined]
        motions.add(counts(f"mock:?speed=max&seed={seed}&exercise={path}"))
        rig.close()
    assert (len(bodies), len(motions)) == (1, 2)


def test_a_sealed_rig_does_not_state_its_truth(tmp_path: Path) -> None:
    rig = open_driver(f"mock:?exercise={written(tmp_path, EXERCISE)}", default_profile())
    assert rig.identity.serial == EXERCISE.serial
    with pytest.raises(UsageError, match="does not state its truth"):
        _ = rig.truth  # type: ignore[attr-defined]
    rig.close()


@pytest.mark.parametrize("option", ["hide=inertia.yaw:1.2", "noise=0", "spread=0.1"])
@pytest.mark.parametrize("scheme", ["mock", "usb+mock"])
def test_no_other_option_changes_its_physics(tmp_path: Path, scheme: str, option: str) -> None:
    url = f"{scheme}:?exercise={written(tmp_path, EXERCISE)}&{option}"
    with pytest.raises(UsageError, match="cannot be combined with exercise="):
        open_driver(url, default_profile())
