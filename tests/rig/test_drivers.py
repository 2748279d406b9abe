"""A faulty driver package hides no rig of another driver, and no emergency stop."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import pytest

from heli3dof.rig import drivers
from heli3dof.rig.session.estop import request_estop


class Sound:
    options = ()

    def find(self) -> Sequence[str]:
        return ["sound:1"]

    def estop(self, url: object) -> str:
        return "zero volts"


class WithoutComma(Sound):
    def find(self) -> Sequence[str]:
        return "lab2:"


class NoUrls(Sound):
    def find(self) -> Sequence[str]:
        return ["/dev/ttyACM0"]


def exits() -> Any:
    raise SystemExit(4)


@pytest.fixture(params=[WithoutComma, NoUrls, exits], ids=["text", "no URL", "exits"])
def faulty(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    points = {
        name: SimpleNamespace(name=name, value="lab", load=lambda made=made: made)
        for name, made in {"faulty": request.param, "sound": Sound}.items()
    }
    monkeypatch.setattr(drivers, "registered", lambda: points)


@pytest.mark.usefixtures("faulty")
def test_a_faulty_driver_hides_no_other_rig() -> None:
    (first, second) = drivers.find_rigs()
    assert first[:2] == ("faulty", [])
    assert first[2]
    assert second == ("sound", ["sound:1"], None)


@pytest.mark.usefixtures("faulty")
def test_an_emergency_stop_gives_a_result_despite_a_faulty_driver() -> None:
    assert [s.device for s in request_estop(None, "a test").stopped] == ["sound:1"]
