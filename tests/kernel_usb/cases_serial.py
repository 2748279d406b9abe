"""pyserial and the kernel's CDC-ACM driver against the emulated rig on dummy_hcd."""

from __future__ import annotations

import subprocess
import time
from pathlib import Path
from typing import Any

from heli3dof_drivers.serial_port import SerialDriver

from heli3dof.rig.interface import Flags
from heli3dof.rig.url import parse_url

from .gadget import FIRMWARE
from .guest import PROFILE, Hand, case, failure, fly, in_another_process, until
from .same_flights import (
    LATCHED,
    OPENING,
    WATCHDOG,
    flies,
    held,
    killed,
    polled,
    pulled,
    stopped_by_another,
    streamed,
)

PORT = Path("/dev/ttyACM0")
URL = f"serial://{PORT}"
DRIVER = SerialDriver()
ELSEWHERE = f"""
from heli3dof_drivers.serial_port import SerialDriver
driver, url = SerialDriver(), parse_url({URL!r})
"""
_hand: list[Hand] = []


def hand() -> Hand:
    """The device's process, with the cable in."""
    if not _hand:
        _hand.append(Hand("tests.kernel_usb.gadget"))
    if not PORT.exists():
        assert _hand[0]("plug") == "ok"
        until(PORT.exists, f"{PORT} is there")
        subprocess.run(["/bin/udevadm", "settle"], check=False)
    return _hand[0]


def rig(options: str = "") -> Any:
    hand()
    return DRIVER.open(parse_url(URL + options), PROFILE)


@case
def serial_the_kernel_makes_a_port_and_it_is_found() -> dict[str, Any]:
    hand()
    assert URL in DRIVER.find(), DRIVER.find()
    output = subprocess.run(
        ["/bin/udevadm", "info", str(PORT)], capture_output=True, text=True, check=True
    ).stdout
    assert "TAGS=:uaccess:" in output, output
    return {c.what: c.found for c in DRIVER.examine(parse_url(URL))}


@case
def serial_a_polled_flight_of_200_round_trips() -> dict[str, Any]:
    return polled(rig("?stream=0"), 200)


@case
def serial_a_streamed_flight() -> dict[str, Any]:
    _, lost = streamed(rig(), 200)
    return lost


@case
def serial_a_second_process_stops_what_the_first_flies() -> dict[str, Any]:
    return {"said": stopped_by_another(rig(), hand(), ELSEWHERE)}


@case
def serial_a_second_process_is_told_that_the_first_holds_the_port() -> dict[str, Any]:
    return {"said": held(rig(), ELSEWHERE)}


@case
def serial_a_user_without_permission_is_told_what_to_do() -> dict[str, Any]:
    hand()
    output = in_another_process(ELSEWHERE + OPENING, user=1000)
    assert "Try:" in output, output
    return {"said": output.splitlines()[0]}


@case
def serial_a_pulled_cable_ends_the_flight_and_the_rig_stops() -> dict[str, Any]:
    r = rig()
    _, result = pulled(r, hand(), lambda: not PORT.exists())
    r.close()
    until(lambda: _hand[0].state()[2:] == (0, 0), "zero volts")
    assert _hand[0].state()[:2] == (LATCHED, WATCHDOG)
    return result


@case
def serial_a_rig_that_is_plugged_in_again_flies_again() -> None:
    flies(rig())


@case
def serial_a_process_that_is_killed_leaves_a_rig_that_stops_itself() -> dict[str, Any]:
    result = killed(hand(), ELSEWHERE)
    rig().close()
    return result


@case
def serial_the_firmware_in_c_flies_behind_a_true_port() -> dict[str, Any]:
    if not FIRMWARE.exists():
        return {"skipped": "the host has no C compiler"}
    assert hand()("firmware") == "ok"
    measured: dict[str, Any] = {}
    try:
        for stream in ("1", "0"):
            r = rig(f"?stream={stream}")
            try:
                assert r.identity.serial == "G1"
                samples = fly(r, 100)
                assert samples[-1].flags == Flags.ENABLED
                assert samples[-1].v_applied == (5.0, 5.0)
                assert r.statistics.malformed == 0
                measured["firmware"] = r.identity.firmware
                measured[f"lost, stream={stream}"] = r.statistics.lost
            finally:
                r.close()
        r = rig()
        fly(r, 10)
        hand()("pull")
        measured["said"] = failure(lambda: fly(r, 100)).what
        r.close()
        until(lambda: not PORT.exists(), f"{PORT} is gone")
        time.sleep(1.5)
        r = rig()
        try:
            sample = r.read()
            assert sample.flags & Flags.LATCHED, sample
            assert sample.v_applied == (0.0, 0.0)
            assert fly(r, 20)[-1].flags == Flags.ENABLED
        finally:
            r.close()
    finally:
        hand()("python")
    return measured
