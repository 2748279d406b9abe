"""pyusb, libusb and the Linux kernel against the emulated rig on vhci-hcd."""

from __future__ import annotations

import os
import statistics
import subprocess
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

from heli3dof_drivers.usb_bulk import UsbDriver

from heli3dof.rig.port import Flags
from heli3dof.rig.url import parse_url

from .guest import (
    PROFILE,
    RATE_HZ,
    Hand,
    case,
    failure,
    fly,
    flying_process,
    in_another_process,
    until,
)

URL = "usb://1209:0001/K1"
DRIVER = UsbDriver()
STOPPED, SUPPLY, HOST_ESTOP = 16, 8, 2
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
    """The rules that ship, in force: logind turns the tag into an access list."""
    hand()
    (device,) = [
        path.parent
        for path in Path("/sys/bus/usb/devices").glob("*/serial")
        if path.read_text().strip() == "K1"
    ]
    said = subprocess.run(
        ["/bin/udevadm", "info", str(device)], capture_output=True, text=True, check=True
    ).stdout
    assert "TAGS=:uaccess:" in said, said
    assert "ID_MM_DEVICE_IGNORE=1" in said, said
    installed = {c.what: c.good for c in DRIVER.examine(parse_url(URL))}
    assert installed["udev rule"]
    return {}


@case
def a_polled_flight_of_400_round_trips() -> dict[str, Any]:
    r = rig("?stream=0")
    try:
        samples = fly(r, 400)
        # A POLL that is answered late is asked again, and its second sample may come after the
        # next command: a sample may be one command behind, never ahead, and never go back.
        behind = [k - sample.sequence for k, sample in enumerate(samples)]
        assert set(behind) <= {0, 1}, behind
        assert len(samples) == 401
        assert samples[-1].flags == Flags.ENABLED
        assert samples[-1].v_applied == (5.0, 5.0)
        s = r.statistics
        trips = s.round_trip
        return {
            "round_trip_median_us": 1e6 * trips.quantile_s(0.5),
            "round_trip_99_us": 1e6 * trips.quantile_s(0.99),
            "repeats": s.repeats,
            "damaged": s.damaged,
            "one_behind": sum(behind),
        }
    finally:
        r.close()


@case
def a_streamed_flight() -> dict[str, Any]:
    r = rig()
    try:
        samples = fly(r, 200)
        assert samples[-1].flags == Flags.ENABLED
        steps = [b.device_time_s - a.device_time_s for a, b in pairwise(samples)]
        s = r.statistics
        assert s.damaged == 0
        assert abs(statistics.median(steps) - PROFILE.dt) < 1e-6
        return {"lost": s.lost, "passed_over": s.passed_over, "unheard": s.unheard}
    finally:
        r.close()


def round_trips(ask: Any, hear: Any) -> dict[str, Any]:
    """400 POLLs and their samples: µs, and how many answers were not one whole sample."""
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
    assert wrong == splitter.damaged == 0
    trips.sort()
    return {"median_us": 1e6 * trips[200], "99_us": 1e6 * trips[396], "wrong": wrong}


@case
def bare_pyusb_round_trips() -> dict[str, Any]:
    """The stack itself, and two emulated processes: what the listener costs is the difference."""
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
    r = rig()
    try:
        assert fly(r, 10)[-1].flags == Flags.ENABLED
        said = in_another_process(ELSEWHERE + "print(driver.estop(url))")
        assert "confirmed" in said
        flags, cause, *volts = hand().state()
        assert (flags, cause, volts) == (STOPPED, HOST_ESTOP, [0, 0])
        assert r.read().flags & Flags.ESTOP
    finally:
        r.close()
    return {"said": said}


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
    r = rig()
    try:
        said = in_another_process(
            ELSEWHERE + "try: driver.open(url, profile)\nexcept DeviceError as error: print(error)"
        )
        assert "is in use by" in said
        assert f"(process {os.getpid()})" in said
    finally:
        r.close()
    return {"said": said.splitlines()[0]}


@case
def a_user_without_permission_is_told_the_rule() -> dict[str, Any]:
    hand()
    said = in_another_process(
        ELSEWHERE + "print(list(driver.find()))\n"
        "print({c.what: c.good for c in driver.examine(url)})\n"
        "try: driver.open(url, profile)\nexcept DeviceError as error: print(error)",
        user=1000,
    )
    assert URL in said.splitlines()[0]  # found all the same, with its serial number
    assert "'permission': False" in said
    assert "may not be opened by this user" in said
    assert "70-heli3dof.rules" in said
    return {"said": said.splitlines()[2]}


@case
def a_stall_of_either_pipe_is_cleared_in_flight() -> dict[str, Any]:
    from heli3dof.rig.port import Command

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
            measured[f"unheard_{pipe}"] = r.statistics.unheard
        finally:
            r.close()
    return measured


@case
def a_pipe_that_stalls_again_ends_the_flight() -> dict[str, Any]:
    said = {}
    for pipe in ("in", "out"):
        r = rig()
        try:
            fly(r, 5)
            hand()(f"stick {pipe}")
            error = failure(lambda r=r: fly(r, 50))
            assert "and again after it was cleared" in str(error), error
            said[pipe] = error.what
        finally:
            hand()("unstick")
            r.close()
    return said


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
    import threading

    from heli3dof.rig.port import Command

    r = rig()
    fly(r, 5)
    threading.Timer(0.2, hand(), ["pull"]).start()

    def on() -> None:
        for k in range(500):
            r.exchange(Command(6 + k, 5.0, 5.0), time.monotonic() + 1 / RATE_HZ)

    start = time.monotonic()
    error = failure(on)
    took = time.monotonic() - start
    assert "was unplugged" in str(error), error
    until(lambda: not DRIVER.find(), "the rig is gone from the list")
    flags, cause, *volts = _hand[0].state()
    assert (flags, cause, volts) == (STOPPED, SUPPLY, [0, 0])
    r.close()
    return {"said": error.what, "errno": error.__cause__.errno, "noticed_s": took - 0.2}


@case
def a_rig_that_is_plugged_in_again_flies_again() -> None:
    r = rig()
    try:
        assert r.read().flags & Flags.ESTOP
        assert fly(r, 20)[-1].flags == Flags.ENABLED
    finally:
        r.close()


@case
def a_process_that_is_killed_leaves_a_rig_that_stops_itself() -> dict[str, Any]:
    """kill -9 in flight: the kernel releases the claim, the watchdog does the rest."""
    hand()
    process = flying_process(ELSEWHERE)
    until(lambda: hand().state()[2] == 5_000_000, "five volts are out")
    process.kill()
    process.wait()
    start = time.monotonic()
    until(lambda: hand().state()[2:] == (0, 0), "zero volts")
    took = time.monotonic() - start
    flags, cause, *_ = hand().state()
    assert (flags, cause) == (8, 1), (flags, cause)
    r = rig()
    r.close()
    return {"zero_after_s": took}
