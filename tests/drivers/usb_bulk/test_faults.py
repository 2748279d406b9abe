"""Each fault of the bus has its own message, and the motors stop in each."""

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
    """The error that ends a run with this fault."""
    plugged = lab.plug()
    rig = lab.open(url)
    lab.set_faults(plugged, fault)
    with pytest.raises(DeviceError) as caught:
        fly(rig, 2000)
    assert caught.value.cause
    assert caught.value.fix
    return caught.value


def test_an_unplugged_cable_ends_the_run_with_its_own_message(lab: Lab):
    error = fly_until(lab, "unplug@0.1")
    assert "was unplugged" in str(error)
    amplifier = lab.bus.rigs[0].function.endpoint.amplifier
    assert amplifier.flags == Flags.ESTOP
    assert amplifier.cause == Cause.SUPPLY
    assert lab.driver.find() == []


def test_after_unplugging_closing_succeeds_and_the_rig_can_be_opened_again(lab: Lab):
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
def test_a_stalled_pipe_is_cleared_and_the_run_continues(lab: Lab, pipe: str, stream: str):
    plugged = lab.plug()
    rig = lab.open(f"usb:?stream={stream}")
    lab.set_faults(plugged, f"stall_{pipe}@0.1")
    samples = fly(rig, 200)
    assert samples[-1].flags == Flags.ENABLED
    assert samples[-1].sequence > 190
    assert rig._pipe.stalls == 1


@pytest.mark.parametrize("pipe", ["in", "out"])
def test_a_pipe_that_stalls_again_ends_the_run(lab: Lab, pipe: str):
    error = fly_until(lab, f"stall_{pipe}@0.1:60")
    assert "and again after it was cleared" in str(error)


def test_a_rig_that_accepts_nothing_is_a_timeout(lab: Lab):
    error = fly_until(lab, "silent@0.1", "usb:?timeout_s=0.1")
    assert "did not answer in time" in str(error)


def test_a_pause_shorter_than_the_timeout_does_not_end_the_run(lab: Lab):
    plugged = lab.plug()
    rig = lab.open()
    lab.set_faults(plugged, "silent@0.1:0.1")
    samples = fly(rig, 200)
    assert samples[-1].flags == Flags.ENABLED


def test_a_stop_works_while_the_pipes_are_stalled(lab: Lab):
    plugged = lab.plug()
    rig = lab.open()
    fly(rig, 20)
    plugged.function.stuck |= {0x01, 0x81}
    rig.estop("test")
    amplifier = plugged.function.endpoint.amplifier
    assert amplifier.output_uV(lab.bus.now_us()) == (0, 0)
    assert amplifier.flags == Flags.ESTOP
    assert amplifier.cause == Cause.HOST_ESTOP


def test_a_stop_works_while_the_pipes_do_not_respond(lab: Lab):
    plugged = lab.plug()
    rig = lab.open("usb:?timeout_s=0.05")
    fly(rig, 20)
    plugged.function.silent = True
    rig.estop("test")
    assert plugged.function.endpoint.amplifier.flags == Flags.ESTOP


def test_a_second_process_can_stop_the_rig_of_the_first(lab: Lab):
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
def test_the_stop_of_a_second_process_is_repeated_while_the_bus_is_busy(
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
        assert plugged.function.endpoint.amplifier.flags == Flags.ESTOP
    else:
        with pytest.raises(DeviceError, match="did not answer in time while stopping it"):
            lab.driver.estop(parse_url("usb:"))
        assert sent.count(STOP) == STOP_TRIES


def test_stopping_a_missing_rig_is_an_error(lab: Lab):
    with pytest.raises(DeviceError, match="no USB rig was"):
        lab.driver.estop(parse_url("usb:"))
    lab.plug(1, "refused@0")
    with pytest.raises(DeviceError, match="no permission"):
        lab.driver.estop(parse_url("usb:"))


def test_a_run_continues_while_others_list_and_open_rigs(lab: Lab):
    plugged = lab.plug()
    fly(lab.open(), 20)
    lab.driver.find()
    lab.driver.examine(parse_url("usb:"))
    with pytest.raises(DeviceError, match="in use"):
        lab.open()
    assert plugged.function.endpoint.amplifier.flags == Flags.ENABLED


NUMBERS = {
    errno.ENODEV: "was unplugged",
    errno.EPIPE: "stalled",
    errno.ETIMEDOUT: "did not answer in time",
    errno.EACCES: "no permission",
    errno.EBUSY: "is in use by someone",
    errno.EIO: "USB transfer failed",
    errno.EOVERFLOW: "sent more than was requested",
    errno.ENOMEM: "errno 12",
}


def test_every_errno_has_its_own_message_cause_and_fix():
    errors = [
        explain(usb.core.USBError("x", errno=n), "usb:", "flying", lambda: "someone")
        for n in NUMBERS
    ]
    errors.append(explain(NotImplementedError(), "usb:", "flying"))
    for error, words in zip(errors, NUMBERS.values(), strict=False):
        assert words in str(error)
    for part in ("what", "cause", "fix"):
        parts = [getattr(e, part) for e in errors]
        assert all(parts)
        if part != "fix":
            assert len(set(parts)) == len(parts)
