"""A descriptor as a line: unplugging is an error, another reader on the terminal is not."""

from __future__ import annotations

import os
import socket
import termios
import time
import tty

import pytest
from heli3dof_drivers.link import descriptor_line
from heli3dof_drivers.link.descriptor_line import DescriptorLine

from heli3dof.errors import DeviceError
from tests.profiles import END_S


def terminal() -> tuple[int, int]:
    """Both ends; the far one as pyserial sets it: an empty read returns at once."""
    ours, far = os.openpty()
    tty.setraw(far)
    settings = termios.tcgetattr(far)
    settings[6][termios.VMIN] = settings[6][termios.VTIME] = 0
    termios.tcsetattr(far, termios.TCSANOW, settings)
    return ours, far


def test_bytes_pass_both_ways_and_a_timeout_returns_none():
    device, host = terminal()
    line = DescriptorLine(host, "line", lambda: os.close(host))
    os.write(device, b"abc")
    assert line.read(END_S) == b"abc"
    start = time.monotonic()
    assert line.read(0.05) == b""
    assert time.monotonic() - start >= 0.045
    line.write(b"xyz")
    assert os.read(device, 10) == b"xyz"
    line.close()
    line.close()
    with pytest.raises(DeviceError, match="is gone"):
        line.read(0.0)
    os.close(device)


def test_an_unplugged_device_is_an_error():
    device, host = terminal()
    line = DescriptorLine(host, "line", lambda: os.close(host))
    os.close(device)
    with pytest.raises(DeviceError, match="is gone"):
        line.read(1.0)
    with pytest.raises(DeviceError, match="is gone"):
        line.write(b"x")
    line.close()


def test_a_closed_socket_is_an_error():
    device, host = socket.socketpair()
    line = DescriptorLine(host.fileno(), "line", host.close)
    device.close()
    with pytest.raises(DeviceError, match="is gone"):
        line.read(1.0)
    line.close()


def test_bytes_read_by_another_process_do_not_end_the_line(
    monkeypatch: pytest.MonkeyPatch,
):
    device, host = terminal()
    line = DescriptorLine(host, "line", lambda: os.close(host))
    # The system reported bytes, and heli3dof estop has read them since.
    select = descriptor_line.select.select
    monkeypatch.setattr(descriptor_line.select, "select", lambda r, w, x, t: (r, w, x))
    assert line.read(1.0) == b""
    os.write(device, b"still here")
    select([host], [], [], END_S)
    assert line.read(1.0) == b"still here"
    os.close(device)
    with pytest.raises(DeviceError, match="is gone"):
        line.read(1.0)
    line.close()


def test_a_full_line_is_an_error():
    device, host = socket.socketpair()
    line = DescriptorLine(host.fileno(), "line", host.close)
    with pytest.raises(DeviceError, match="accepts no more bytes"):
        line.write(bytes(10_000_000))
    line.close()
    device.close()
