"""The system's information on ports, and the errors of a port that does not open."""

from __future__ import annotations

import errno
import fcntl
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from heli3dof_drivers.link.serial_line import pyserial_url, refused
from heli3dof_drivers.link.serial_ports import (
    held_by,
    holders,
    is_known,
    lockers,
    permission_fix,
    persistent_name,
)

from heli3dof.errors import UsageError
from heli3dof.rig.url import parse_url


@pytest.mark.parametrize(
    ("number", "what", "fix"),
    [
        (errno.EACCES, "not permitted", "usermod|udevadm"),
        (errno.EPERM, "not permitted", "usermod|udevadm"),
        (errno.EBUSY, "is busy", "heli3dof estop"),
        (errno.EAGAIN, "is busy", "heli3dof estop"),
        (errno.ENOENT, "no such port", "heli3dof devices"),
        (errno.ENODEV, "no such port", "heli3dof devices"),
        (errno.EIO, "does not open", "heli3dof devices"),
    ],
)
def test_each_refusal_has_its_own_cause_and_fix(number: int, what: str, fix: str):
    error = refused("/dev/ttyUSB9", OSError(number, os.strerror(number)))
    assert what in error.what
    assert error.cause
    assert any(word in error.fix for word in fix.split("|"))
    assert error.exit_code == 3


def test_the_group_of_the_port_is_the_one_to_join(tmp_path: Path):
    port = tmp_path / "port"
    port.touch()
    assert "usermod -aG dialout" in permission_fix("/dev/ttyNONE")
    if os.stat(port).st_gid == 0:
        assert "udevadm" in permission_fix(str(port))  # no user should join the group root


def test_processes_that_lock_a_port_differ_from_those_that_have_it_open(tmp_path: Path):
    port = tmp_path / "port"
    port.touch()
    assert lockers(str(port)) == []
    with port.open() as file:
        assert holders(str(port)) == []  # this process does not count
        fcntl.flock(file, fcntl.LOCK_EX)
        assert [pid for pid, _ in lockers(str(port))] in ([os.getpid()], [])
    assert held_by("/dev/ttyNONE") == "a process of another user"


def test_pyserials_name_of_a_place():
    def place(url: str) -> str:
        return pyserial_url(parse_url(url))

    assert place("serial:///dev/ttyACM0?baud=9600") == "/dev/ttyACM0"
    assert place("serial://COM3") == "COM3"
    assert place("serial+spy:///dev/ttyACM0?file=a") == "spy:///dev/ttyACM0?file=a"
    assert place("serial+loop:") == "loop://"
    with pytest.raises(UsageError, match="names no port"):
        place("serial:")


def on_usb(monkeypatch: pytest.MonkeyPatch, path: Path, **port: object) -> None:
    """The only port, on USB."""
    info = SimpleNamespace(**{"device": str(path), "serial_number": None, "location": "1-2"} | port)
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: [info])


def test_a_device_is_named_by_its_serial_number(monkeypatch, tmp_path):
    port, link = tmp_path / "ttyACM0", tmp_path / "by-id"
    port.touch()
    link.symlink_to(port)
    on_usb(monkeypatch, port, vid=0x2341, pid=0x43, serial_number="A1")
    assert persistent_name(str(port)) == persistent_name(str(link)) == "2341:0043 A1"
    on_usb(monkeypatch, port, vid=0x1A86, pid=0x7523)
    assert persistent_name(str(port)) == "1a86:7523 at 1-2"
    assert persistent_name("/dev/ttyS0") == "/dev/ttyS0"


def test_a_later_pseudo_terminal_of_the_same_number_has_another_name():
    ours, theirs = os.openpty()
    path = os.ttyname(theirs)
    first = persistent_name(path)
    assert first.startswith(f"{path} of ")
    assert persistent_name(path) == first
    os.close(ours)
    os.close(theirs)
    assert persistent_name(path) != first


def test_a_rig_is_known_by_the_usb_numbers_of_the_rule(monkeypatch, tmp_path):
    on_usb(monkeypatch, tmp_path, vid=0x1209, pid=0x0001)
    assert is_known(str(tmp_path))
    on_usb(monkeypatch, tmp_path, vid=0x2341, pid=0x0043)
    assert not is_known(str(tmp_path))


def test_a_port_held_by_heli3dof_counts_as_a_rig(tmp_path):
    port = tmp_path / "port"
    port.touch()
    take = f"import fcntl, time; f = open({str(port)!r}, 'r+'); fcntl.flock(f, 2)"
    for name, known in (("heli3dof", True), ("octoprint", False)):
        command = [sys.executable, "-c", f"{take}; print(flush=True); time.sleep(600)", name]
        with subprocess.Popen(command, stdout=subprocess.PIPE) as holder:
            assert holder.stdout is not None
            holder.stdout.readline()
            assert is_known(str(port)) is known
            holder.kill()
