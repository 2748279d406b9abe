"""What the system tells of a port, and what a user is told when one does not open."""

from __future__ import annotations

import errno
import fcntl
import os
from pathlib import Path

import pytest
from heli3dof_drivers.link.ports import held_by, holders, lockers, permission_fix
from heli3dof_drivers.link.serial_line import pyserial_url, refused

from heli3dof.errors import UsageError


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
        assert "udevadm" in permission_fix(str(port))  # nobody should join the group root


def test_who_has_locked_a_port_is_told_from_who_has_it_open(tmp_path: Path):
    port = tmp_path / "port"
    port.touch()
    assert lockers(str(port)) == []
    with port.open() as file:
        assert holders(str(port)) == []  # ourselves do not count
        fcntl.flock(file, fcntl.LOCK_EX)
        assert [pid for pid, _ in lockers(str(port))] in ([os.getpid()], [])
    assert held_by("/dev/ttyNONE") == "a process of another user"


def test_pyserials_name_of_a_place():
    assert pyserial_url("serial", "/dev/ttyACM0") == "/dev/ttyACM0"
    assert pyserial_url("serial", "COM3") == "COM3"
    assert pyserial_url("serial+spy", "/dev/ttyACM0") == "spy:///dev/ttyACM0"
    assert pyserial_url("serial+loop", "") == "loop://"
    with pytest.raises(UsageError, match="names no port"):
        pyserial_url("serial", "")
