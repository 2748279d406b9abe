"""What the bus can do to a rig: each has its own message, and the motors stop in each."""

from __future__ import annotations

import errno
import time
from typing import Any

import pytest
import usb.core
from heli3dof_drivers.link.frames import Cause
from heli3dof_drivers.usb_bulk.driver import STOP_TRIES
from heli3dof_drivers.usb_bulk.errors import explain
from heli3dof_drivers.usb_bulk.transport import STOP

from heli3dof.errors import DeviceError
from heli3dof.rig.interface import Command, Flags
from heli3dof.rig.url import parse_url

from .laboratory import Lab, fly


def fly_until(lab: Lab, fault: str, url: str = "usb:") -> DeviceError:
    """What ends a flight that this fault befalls."""
    plugged = lab.plug()
    rig = lab.open(url)
    lab.befall(plugged, fault)
    with pytest.raises(DeviceError) as caught:
        fly(rig, 2000)
    assert caught.value.cause
    assert caught.value.fix
    return caught.value


def test_a_pulled_cable_ends_the_flight_and_says_so(lab: Lab):
    error = fly_until(lab, "unplug@0.1")
    assert "was unplugged" in str(error)
    amplifier = lab.bus.rigs[0].function.link.amplifier
    assert amplifier.flags == Flags.ESTOP
    assert amplifier.cause == Cause.SUPPLY
    assert lab.driver.find() == []


def test_after_a_pulled_cable_closing_is_quiet_and_the_rig_can_be_opened_again(lab: Lab):
    plugged = lab.plug()
    first = lab.open()
    fly(first, 20)
    lab.bus.unplug(plugged)
    lab.bus.plug(plugged)
    with pytest.raises(DeviceError, match="was unplugged"):
        fly(first, 20)
    first.close()
    again = lab.open()
    assert again.read().flags & Flags.ESTOP  # stopped by the bus until it is armed
    assert fly(again, 20)[-1].flags == Flags.ENABLED


@pytest.mark.parametrize("pipe", ["in", "out"])
@pytest.mark.parametrize("stream", ["0", "1"])
def test_a_stalled_pipe_is_cleared_and_the_flight_goes_on(lab: Lab, pipe: str, stream: str):
    plugged = lab.plug()
    rig = lab.open(f"usb:?stream={stream}")
    lab.befall(plugged, f"stall_{pipe}@0.1")
    samples = fly(rig, 200)
    assert samples[-1].flags == Flags.ENABLED
    assert samples[-1].sequence > 190
    assert rig._pipe.stalls == 1


@pytest.mark.parametrize("pipe", ["in", "out"])
def test_a_pipe_that_stalls_again_ends_the_flight(lab: Lab, pipe: str):
    error = fly_until(lab, f"stall_{pipe}@0.1:60")
    assert "and again after it was cleared" in str(error)


def test_a_rig_that_takes_nothing_any_more_is_told_apart(lab: Lab):
    error = fly_until(lab, "silent@0.1", "usb:?timeout_s=0.1")
    assert "did not answer in time" in str(error)


def test_silence_shorter_than_the_patience_is_survived(lab: Lab):
    plugged = lab.plug()
    rig = lab.open()
    lab.befall(plugged, "silent@0.1:0.1")
    samples = fly(rig, 200)
    assert samples[-1].flags == Flags.ENABLED


def test_the_stop_goes_past_stalled_pipes(lab: Lab):
    plugged = lab.plug()
    rig = lab.open()
    fly(rig, 20)
    plugged.function.stuck |= {0x01, 0x81}
    rig.estop("test")
    amplifier = plugged.function.link.amplifier
    assert amplifier.output_uV(lab.bus.now_us()) == (0, 0)
    assert amplifier.flags == Flags.ESTOP
    assert amplifier.cause == Cause.HOST_ESTOP


def test_the_stop_goes_past_pipes_that_answer_nothing(lab: Lab):
    plugged = lab.plug()
    rig = lab.open("usb:?timeout_s=0.05")
    fly(rig, 20)
    plugged.function.silent = True
    rig.estop("test")
    assert plugged.function.link.amplifier.flags == Flags.ESTOP


def test_the_stop_of_a_second_process_works_while_the_first_flies(lab: Lab):
    lab.plug()
    rig = lab.open()
    assert fly(rig, 50)[-1].flags == Flags.ENABLED
    assert "confirmed" in lab.driver.estop(parse_url("usb://1209:0001/mock-1"))
    for k in range(5):
        sample = rig.exchange(Command(51 + k, 5.0, 5.0), time.monotonic() + 0.002)
    assert sample.flags & Flags.ESTOP
    assert sample.v_applied == (0.0, 0.0)
    assert fly(rig, 50)[-1].flags == Flags.ENABLED  # the first still holds the pipes


@pytest.mark.parametrize("busy", [3, 1000])
def test_the_stop_of_a_second_process_is_sent_again_while_the_bus_is_busy(
    lab: Lab, monkeypatch: pytest.MonkeyPatch, busy: int
):
    plugged = lab.plug()
    fly(lab.open(), 20)
    sent, through = [], lab.bus.ctrl_transfer

    def transfer(*request: Any) -> int:
        sent.append(request[2])
        if sent.count(STOP) <= busy:
            raise usb.core.USBTimeoutError("timeout", errno=errno.ETIMEDOUT)
        return through(*request)

    monkeypatch.setattr(lab.bus, "ctrl_transfer", transfer)
    if busy == 3:
        assert "confirmed" in lab.driver.estop(parse_url("usb:"))
        assert plugged.function.link.amplifier.flags == Flags.ESTOP
    else:
        with pytest.raises(DeviceError, match="did not answer in time while stopping it"):
            lab.driver.estop(parse_url("usb:"))
        assert sent.count(STOP) == STOP_TRIES


def test_the_stop_of_a_rig_that_is_gone_is_an_error(lab: Lab):
    with pytest.raises(DeviceError, match="no USB rig is"):
        lab.driver.estop(parse_url("usb:"))
    lab.plug(1, "refused@0")
    with pytest.raises(DeviceError, match="may not be opened"):
        lab.driver.estop(parse_url("usb:"))


def test_a_rig_that_is_flown_already_goes_on_while_others_look(lab: Lab):
    plugged = lab.plug()
    fly(lab.open(), 20)
    lab.driver.find()
    lab.driver.examine(parse_url("usb:"))
    with pytest.raises(DeviceError, match="in use"):
        lab.open()
    assert plugged.function.link.amplifier.flags == Flags.ENABLED


NUMBERS = {
    errno.ENODEV: "was unplugged",
    errno.EPIPE: "stalled",
    errno.ETIMEDOUT: "did not answer in time",
    errno.EACCES: "may not be opened",
    errno.EBUSY: "is in use by someone",
    errno.EIO: "the bus failed",
    errno.EOVERFLOW: "sent more than was asked for",
    errno.ENOMEM: "errno 12",
}


def test_every_errno_has_a_message_a_cause_and_a_fix_of_its_own():
    said = [
        explain(usb.core.USBError("x", errno=n), "usb:", "flying", lambda: "someone")
        for n in NUMBERS
    ]
    said.append(explain(NotImplementedError(), "usb:", "flying"))
    for error, words in zip(said, NUMBERS.values(), strict=False):
        assert words in str(error)
    for part in ("what", "cause", "fix"):
        parts = [getattr(e, part) for e in said]
        assert all(parts)
        if part != "fix":
            assert len(set(parts)) == len(parts)
