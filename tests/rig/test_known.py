"""A place is a rig's where one was opened before, however it is plugged in now."""

from __future__ import annotations

import pytest

from heli3dof.rig.known import is_known, remember
from heli3dof.rig.url import DeviceUrl
from tests.rig.fakes import FakeDriver, only_drivers


class Ports(FakeDriver):
    """`boards` by where they are plugged in."""

    boards: dict[str, str]

    def surely(self, url: DeviceUrl) -> bool:
        return False

    def lasting(self, url: DeviceUrl) -> str:
        return self.boards[url.where]


@pytest.fixture
def ports(tmp_path, monkeypatch) -> Ports:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    driver = Ports()
    driver.boards = {"a": "board 1", "b": "board 2"}
    only_drivers(monkeypatch, fake=driver)
    return driver


def test_what_was_opened_is_known_at_another_port_and_its_port_is_not(ports):
    assert not is_known("fake://a")
    remember("fake://a?baud=9600")
    assert (is_known("fake://a"), is_known("fake://b")) == (True, False)
    ports.boards = {"a": "board 2", "b": "board 1"}
    assert (is_known("fake://a"), is_known("fake://b")) == (False, True)


def test_it_is_kept_once(ports, tmp_path):
    remember("fake://a")
    remember("fake://a")
    assert (tmp_path / "heli3dof" / "places").read_text() == "fake board 1\n"


def test_a_driver_that_lists_rigs_only_needs_no_memory(monkeypatch):
    only_drivers(monkeypatch, fake=FakeDriver())
    remember("fake://1")
    assert is_known("fake://1")


def test_a_state_folder_that_cannot_be_written_hinders_nothing(ports, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", "/dev/null")
    remember("fake://a")
    assert not is_known("fake://a")
