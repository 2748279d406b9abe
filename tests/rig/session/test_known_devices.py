"""Known devices: a place is known if a rig was opened there before, at any port."""

from __future__ import annotations

import pytest

from heli3dof.rig.session.known_devices import MOST, is_known, remember, remembered, serials_at
from heli3dof.rig.url import DeviceUrl
from tests.rig.fakes import FakeDriver, only_drivers


class Ports(FakeDriver):
    """`boards` by where they are plugged in."""

    boards: dict[str, str]

    def is_rig(self, url: DeviceUrl) -> bool:
        return False

    def persistent_name(self, url: DeviceUrl) -> str:
        return self.boards[url.where]


@pytest.fixture
def ports(tmp_path, monkeypatch) -> Ports:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    driver = Ports()
    driver.boards = {"a": "board 1", "b": "board 2"}
    only_drivers(monkeypatch, fake=driver)
    return driver


def test_a_device_is_known_at_another_port_and_its_old_port_is_not(ports):
    assert not is_known("fake://a")
    remember("fake://a?baud=9600", "S1")
    assert (is_known("fake://a"), is_known("fake://b")) == (True, False)
    ports.boards = {"a": "board 2", "b": "board 1"}
    assert (is_known("fake://a"), is_known("fake://b")) == (False, True)


def test_a_device_is_stored_once(ports, tmp_path):
    remember("fake://a", "S1")
    remember("fake://a?baud=9600", "S1")
    kept = (tmp_path / "heli3dof" / "places").read_text()
    assert kept == "fake board 1\tfake://a?baud=9600\tS1\n"
    assert list(remembered()) == ["fake://a?baud=9600"]


def test_a_file_of_an_earlier_version_is_read(ports, tmp_path):
    (tmp_path / "heli3dof").mkdir()
    (tmp_path / "heli3dof" / "places").write_text("fake board 1\n")
    assert (is_known("fake://a"), is_known("fake://b")) == (True, False)
    assert list(remembered()) == []
    remember("fake://a", "S1")
    assert list(remembered()) == ["fake://a"]


def test_a_device_that_was_unplugged_is_not_listed(ports):
    remember("fake://a", "S1")
    ports.boards = {"a": "board 3"}
    assert list(remembered()) == []


def test_serial_numbers_come_from_the_place_and_the_url(ports):
    remember("fake://a", "S1")
    assert "S1" in serials_at("fake://a?baud=1")
    assert serials_at("fake://1209:0001/S2") == {"S2"}


def test_the_file_has_a_largest_size(ports, tmp_path):
    for k in range(MOST + 50):
        ports.boards["a"] = f"board {k}"
        remember("fake://a", "S1")
    lines = (tmp_path / "heli3dof" / "places").read_text().splitlines()
    assert len(lines) == MOST
    assert lines[-1].startswith(f"fake board {MOST + 49}\t")


def test_every_place_of_a_driver_that_lists_only_rigs_is_known(monkeypatch):
    only_drivers(monkeypatch, fake=FakeDriver())
    remember("fake://1", "S1")
    assert is_known("fake://1")


def test_an_unwritable_state_folder_is_ignored(ports, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", "/dev/null")
    remember("fake://a", "S1")
    assert not is_known("fake://a")
