"""The emulated rig as a USB device follows docs/reference/protocol.md, section USB."""

from __future__ import annotations

import pytest
from heli3dof_drivers.emulator.usb_function import FIFO, IN, OUT
from heli3dof_drivers.link.frames import Arm, Cause, Splitter, wire

from tests.drivers.emulator.still import still_endpoint
from tests.drivers.link.golden_transcripts import TRANSCRIPTS, Line
from tests.kernel_usb.usb_requests import KernelUsbFunction, Setup


def function() -> KernelUsbFunction:
    return KernelUsbFunction(still_endpoint(), "G1")


def get(kind: int, index: int = 0, length: int = 255) -> Setup:
    return Setup(0x80, 6, kind << 8 | index, 0, length)


@pytest.mark.parametrize("packet", [1, 7, 64, 512])
@pytest.mark.parametrize("name", TRANSCRIPTS)
def test_the_pipes_carry_the_golden_transcripts_in_transfers_of_any_size(name: str, packet: int):
    usb, lines = function(), TRANSCRIPTS[name]
    # The host may collect the device's bytes at any time before its next request.
    requests = [i for i, line in enumerate(lines) if line.sender == "host"]
    for i, following in zip(requests, [*requests[1:], len(lines)], strict=True):
        data = lines[i].bytes
        for start in range(0, len(data), packet):
            assert usb.receive(lines[i].time_us, data[start : start + packet]) is True
        answers: tuple[Line, ...] = lines[i + 1 : following]
        heard = b""
        for line in answers or (lines[i],):
            if line.sender == "clock":
                usb.endpoint.held_up(line.time_us)
            while part := usb.send(line.time_us, packet):
                heard += part
        assert heard == b"".join(line.bytes for line in answers)


def test_the_descriptors_are_those_of_the_protocol():
    usb = function()
    device, configuration = usb.setup(0, get(1)), usb.setup(0, get(2))
    assert device is not None
    assert configuration is not None
    assert device[8:12].hex() == "09120100"  # 1209:0001
    assert len(configuration) == int.from_bytes(configuration[2:4], "little") == 32
    assert configuration[14:17].hex() == "ff4801"
    assert configuration[18:].hex() == "07050102000200" + "07058102000200"
    serial = usb.setup(0, get(3, device[16]))
    assert serial is not None
    assert serial[2:].decode("utf-16-le") == "G1"


def test_a_shorter_request_gets_a_shorter_reply():
    assert function().setup(0, get(2, length=9)) == function().setup(0, get(2))[:9]  # type: ignore[index]


def test_an_unknown_request_is_stalled():
    usb = function()
    assert usb.setup(0, get(9)) is None
    assert usb.setup(0, Setup(0x40, 0x46, 0, 0, 0)) is None
    assert usb.setup(0, Setup(0x00, 9, 2, 0, 0)) is None


def test_the_stop_request_stops_with_its_reason_and_without_a_reply_on_the_pipe():
    usb = function()
    usb.receive(1000, wire(Arm(0, 1, 0, 0)))
    usb.send(1000, 512)
    assert usb.setup(1500, Setup(0x40, 0x45, Cause.BUTTON, 0, 0)) == b""
    amplifier = usb.endpoint.amplifier
    assert (amplifier.flags, amplifier.cause) == (16, Cause.BUTTON)
    assert usb.send(1500, 512) == b""


def test_removing_the_configuration_stops_with_cause_supply():
    usb = function()
    usb.receive(1000, wire(Arm(0, 1, 0, 0)))
    assert usb.setup(1500, Setup(0x00, 9, 0, 0, 0)) == b""
    amplifier = usb.endpoint.amplifier
    assert (amplifier.flags, amplifier.cause) == (16, Cause.SUPPLY)


@pytest.mark.parametrize("pipe", [OUT, IN])
def test_a_halted_pipe_stalls_until_it_is_cleared(pipe: int):
    usb = function()
    usb.setup(0, Setup(0x02, 3, 0, pipe, 0))
    assert usb.setup(0, Setup(0x82, 0, 0, pipe, 2)) == b"\x01\x00"
    assert (usb.receive(0, b"\0") if pipe == OUT else usb.send(0, 512)) is None
    usb.setup(0, Setup(0x02, 1, 0, pipe, 0))
    assert (usb.receive(0, b"\0") if pipe == OUT else usb.send(0, 512)) is not None


def test_a_host_that_does_not_read_loses_whole_frames():
    usb = function()
    usb.receive(0, wire(Arm(0, 1, 1000, 0)))
    for t_us in range(0, 1_900_000, 50_000):
        usb.receive(t_us, b"\0")
    data = b""
    while part := usb.send(1_900_000, 512):
        data += part
    assert len(data) <= FIFO
    splitter = Splitter()
    assert splitter.feed(data)
    assert splitter.malformed == 0
