"""The emulated line delays bytes and keeps their order."""

from __future__ import annotations

from heli3dof_drivers.emulator.transport_pty import Delay


def test_bytes_arrive_after_the_delay_in_order() -> None:
    line = Delay(5000)
    line.put(0, b"a")
    line.put(100, b"")
    line.put(200, b"b")
    assert line.next_us() == 5000
    assert line.get(4999) == b""
    assert line.get(5000) == b"a"
    assert line.get(9000) == b"b"
    assert line.next_us() is None


def test_without_a_delay_bytes_arrive_at_once() -> None:
    line = Delay()
    line.put(7, b"abc")
    assert line.get(7) == b"abc"
