"""pyusb, libusb and the Linux kernel against the emulated rig on vhci-hcd."""

from __future__ import annotations

import statistics
import subprocess
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

from heli3dof_drivers.usb_bulk import UsbDriver

from heli3dof.rig.interface import Flags
from heli3dof.rig.url import parse_url

from .guest import PROFILE, RATE_HZ, Hand, case, failure, fly, in_another_process, until
from .same_flights import (
    HOST_ESTOP,
    OPENING,
    STOPPED,
    flies,
    held,
    killed,
    polled,
    pulled,
    stopped_by_another,
    streamed,
)

URL = "usb://1209:0001/K1"
DRIVER = UsbDriver()
SUPPLY = 8
_hand: list[Hand] = []
ELSEWHERE = f"""
from heli3dof_drivers.usb_bulk import UsbDriver
driver, url = UsbDriver(), parse_url({URL!r})
"""


def hand() -> Hand:
    """The device's process, with the cable in."""
    if not _hand:
        _hand.append(Hand("tests.kernel_usb.usbip"))
    if not DRIVER.find():
        assert _hand[0]("plug") == "ok"
        until(DRIVER.find, f"the rig is listed; {DRIVER.examine(parse_url(URL))}")
    return _hand[0]


def rig(options: str = "") -> Any:
    hand()
    return DRIVER.open(parse_url(URL + options), PROFILE)


@case
def the_kernel_enumerates_the_rig_and_it_is_found() -> dict[str, Any]:
    hand()
    assert list(DRIVER.find()) == [URL]
    start = time.monotonic()
    DRIVER.find()
    checks = {c.what: c for c in DRIVER.examine(parse_url(URL))}
    assert checks["USB rig"].good
    assert checks["permission"].good
    return {"find_ms": 1e3 * (time.monotonic() - start), "rig": checks["USB rig"].found}


@case
def udev_gives_the_rig_to_whoever_sits_there() -> dict[str, Any]:
    """The rules that ship are in force: logind turns the tag into an access list."""
    hand()
    (device,) = [
        path.parent
        for path in Path("/sys/bus/usb/devices").glob("*/serial")
        if path.read_text().strip() == "K1"
    ]
    output = subprocess.run(
        ["/bin/udevadm", "info", str(device)], capture_output=True, text=True, check=True
    ).stdout
    assert "TAGS=:uaccess:" in output, output
    assert "ID_MM_DEVICE_IGNORE=1" in output, output
    installed = {c.what: c.good for c in DRIVER.examine(parse_url(URL))}
    assert installed["udev rule"]
    return {}


@case
def a_polled_flight_of_400_round_trips() -> dict[str, Any]:
    return polled(rig("?stream=0"), 400)


@case
def a_streamed_flight() -> dict[str, Any]:
    samples, lost = streamed(rig(), 200)
    steps = [b.device_time_s - a.device_time_s for a, b in pairwise(samples)]
    assert abs(statistics.median(steps) - PROFILE.dt) < 1e-6
    return lost


def round_trips(ask: Any, hear: Any) -> dict[str, Any]:
    """400 POLLs: times in µs, and the number of replies that were not one sample."""
    from heli3dof_drivers.link.frames import Poll, SampleFrame, Splitter, wire

    trips, splitter, wrong = [], Splitter(), 0
    for k in range(400):
        start = time.monotonic()
        ask(wire(Poll(k)))
        frames: list[Any] = []
        while not frames and time.monotonic() < start + 2:
            frames = list(splitter.feed(hear()))
        trips.append(time.monotonic() - start)
        wrong += len(frames) != 1 or not isinstance(frames[0], SampleFrame)
    assert wrong == splitter.malformed == 0
    trips.sort()
    return {"median_us": 1e6 * trips[200], "99_us": 1e6 * trips[396], "wrong": wrong}


@case
def bare_pyusb_round_trips() -> dict[str, Any]:
    """The stack alone, to compare with the transport's reading thread."""
    import usb.util
    from heli3dof_drivers.usb_bulk.devices import select, system_backend

    hand()
    device = select(system_backend(), URL, URL.partition("//")[2]).device
    try:
        return round_trips(
            lambda data: device.write(0x01, data, 1000),
            lambda: device.read(0x81, 512, 1000).tobytes(),
        )
    finally:
        usb.util.dispose_resources(device)


@case
def transport_round_trips() -> dict[str, Any]:
    from heli3dof_drivers.usb_bulk.devices import select, system_backend
    from heli3dof_drivers.usb_bulk.transport import UsbTransport

    hand()
    on = select(system_backend(), URL, URL.partition("//")[2])
    pipe = UsbTransport(on.device, URL)
    try:
        return round_trips(pipe.write, lambda: pipe.read(0.5))
    finally:
        pipe.close()


@case
def a_second_process_stops_what_the_first_flies() -> dict[str, Any]:
    output = stopped_by_another(rig(), hand(), ELSEWHERE)
    assert "confirmed" in output
    return {"said": output}


@case
def a_stop_goes_past_stalled_pipes() -> None:
    r = rig()
    try:
        fly(r, 10)
        hand()("stick in")
        hand()("stick out")
        in_another_process(ELSEWHERE + "driver.estop(url)")
        assert hand().state()[:2] == (STOPPED, HOST_ESTOP)
    finally:
        hand()("unstick")
        r.close()


@case
def a_second_process_is_told_that_the_first_holds_the_rig() -> dict[str, Any]:
    return {"said": held(rig(), ELSEWHERE)}


@case
def a_user_without_permission_is_told_the_rule() -> dict[str, Any]:
    hand()
    output = in_another_process(
        ELSEWHERE + "print(list(driver.find()))\n"
        "print({c.what: c.good for c in driver.examine(url)})\n" + OPENING,
        user=1000,
    )
    assert URL in output.splitlines()[0]  # found all the same, with its serial number
    assert "'permission': False" in output
    assert "this user has no permission to open it" in output
    assert "70-heli3dof.rules" in output
    return {"said": output.splitlines()[2]}


@case
def a_stall_of_either_pipe_is_cleared_in_flight() -> dict[str, Any]:
    from heli3dof.rig.interface import Command

    measured = {}
    for pipe in ("in", "out"):
        r = rig()
        try:
            fly(r, 10)
            hand()(f"stall {pipe}")
            for k in range(20):
                sample = r.exchange(Command(11 + k, 5.0, 5.0), time.monotonic() + 1 / RATE_HZ)
            assert sample.flags == Flags.ENABLED
            assert r._pipe.stalls == 1, r._pipe.stalls
            measured[f"commands_unacknowledged_{pipe}"] = r.statistics.commands_unacknowledged
        finally:
            r.close()
    return measured


@case
def a_pipe_that_stalls_again_ends_the_flight() -> dict[str, Any]:
    output = {}
    for pipe in ("in", "out"):
        r = rig()
        try:
            fly(r, 5)
            hand()(f"stick {pipe}")
            error = failure(lambda r=r: fly(r, 50))
            assert "and again after it was cleared" in str(error), error
            output[pipe] = error.what
        finally:
            hand()("unstick")
            r.close()
    return output


@case
def a_rig_that_takes_nothing_is_a_timeout() -> dict[str, Any]:
    r = rig("?timeout_s=0.3")
    try:
        fly(r, 5)
        hand()("silent 1")
        error = failure(lambda: fly(r, 50))
        assert "did not answer in time" in str(error), error
    finally:
        hand()("silent 0")
        r.close()
    return {"said": error.what, "errno": error.__cause__.errno}


@case
def a_pulled_cable_ends_the_flight_and_the_rig_stops() -> dict[str, Any]:
    r = rig()
    error, result = pulled(r, hand(), lambda: not DRIVER.find())
    assert "was unplugged" in str(error), error
    assert _hand[0].state() == (STOPPED, SUPPLY, 0, 0)
    r.close()
    return {**result, "errno": error.__cause__.errno}


@case
def a_rig_that_is_plugged_in_again_flies_again() -> None:
    r = rig()
    assert r.read().flags & Flags.ESTOP
    flies(r)


@case
def a_process_that_is_killed_leaves_a_rig_that_stops_itself() -> dict[str, Any]:
    result = killed(hand(), ELSEWHERE)
    rig().close()
    return result
