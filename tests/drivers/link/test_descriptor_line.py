"""A descriptor as a line: gone is gone, and a thief on the same terminal is not."""

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
    """Ours, and the far end, as pyserial sets it: a read of nothing returns at once."""
    ours, far = os.openpty()
    tty.setraw(far)
    settings = termios.tcgetattr(far)
    settings[6][termios.VMIN] = settings[6][termios.VTIME] = 0
    termios.tcsetattr(far, termios.TCSANOW, settings)
    return ours, far


def test_what_is_written_is_read_and_silence_is_empty():
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


def test_a_device_that_goes_away_is_gone():
    device, host = terminal()
    line = DescriptorLine(host, "line", lambda: os.close(host))
    os.close(device)
    with pytest.raises(DeviceError, match="is gone"):
        line.read(1.0)
    with pytest.raises(DeviceError, match="is gone"):
        line.write(b"x")
    line.close()


def test_a_socket_that_closes_is_gone():
    device, host = socket.socketpair()
    line = DescriptorLine(host.fileno(), "line", host.close)
    device.close()
    with pytest.raises(DeviceError, match="is gone"):
        line.read(1.0)
    line.close()


def test_bytes_that_another_reader_took_first_are_not_the_end_of_the_line(
    monkeypatch: pytest.MonkeyPatch,
):
    device, host = terminal()
    line = DescriptorLine(host, "line", lambda: os.close(host))
    # The system said that bytes are there; heli3dof estop, beside us, has read them since.
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


def test_a_line_that_takes_no_more_says_so():
    device, host = socket.socketpair()
    line = DescriptorLine(host.fileno(), "line", host.close)
    with pytest.raises(DeviceError, match="takes no more bytes"):
        line.write(bytes(10_000_000))
    line.close()
    device.close()
