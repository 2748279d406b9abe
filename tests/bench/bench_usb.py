"""Measures the USB transport: flights on the emulated bus, and on Linux's USB stack in a VM."""

from __future__ import annotations

import os
from typing import Any

from heli3dof.experiment.control_loop.realtime_priority import realtime
from heli3dof.rig.drivers import open_driver
from heli3dof.rig.interface import Command
from heli3dof.rig.profile import default_profile
from tests.bench import Figure, Table, at_most
from tests.kernel_usb.packages import Missing
from tests.kernel_usb.run import run_guest

TITLE = "The USB transport"
INTRO = (
    "Emulated bus: pyusb with an emulated backend; device and host in one process, 500 Hz."
    " Real stack: libusb, the Linux kernel's USB core and udev in a virtual "
    "machine without KVM, the emulated rig on vhci-hcd (`usb://`) and, Python and C, behind "
    "dummy_hcd's `/dev/ttyACM0` (`serial://`), at 50 Hz. An emulated processor is slow: its times "
    "are comparable only with each other."
)
SECONDS = float(os.environ.get("USB_SECONDS", "30"))


def measure() -> list[Figure | Table]:
    return [*(flown(stream) for stream in (True, False)), *in_the_guest()]


def flown(stream: bool) -> Figure:
    """Measures one flight over the emulated bus; ``stream``: the device keeps time."""
    profile = default_profile()
    rig: Any = open_driver(f"usb+mock:?start=level&stream={int(stream)}", profile)
    n = round(SECONDS / profile.dt)
    try:
        with realtime() as granted:
            due = rig.arm().host_time_s
            for k in range(n):
                due += profile.dt
                rig.exchange(Command(k + 1, 7.456, 7.456), due)
        s = rig.statistics
    finally:
        rig.close()
    trips = s.round_trip
    how = (
        f"{n} periods, {s.samples_stale} stale samples, "
        f"{s.commands_unacknowledged} commands not echoed in time, {s.malformed} malformed; "
        + ("" if granted.scheduled else "not ")
        + "under SCHED_FIFO"
    )
    if not stream:
        how += (
            f"; round trip median {1e6 * trips.quantile_s(0.5):.0f} µs, "
            f"99.9 % {1e6 * trips.quantile_s(0.999):.0f} µs"
        )
    what = "samples lost, " + ("streamed" if stream else "polled")
    return at_most(what, s.lost, 0, "", how=how)


def in_the_guest() -> list[Figure | Table]:
    """Runs the tests of `make test-kernel-usb` in a virtual machine; returns its measurements."""
    try:
        lines = run_guest()
    except Missing as reason:
        return [Figure("cases over a real USB stack", "not run", how=f"{reason}")]
    cases = [line for line in lines if "case" in line]
    failed = [line["case"] for line in cases if not line["ok"]]
    whole = any("done" in line for line in lines)
    kernel = next((line["kernel"] for line in lines if "kernel" in line), "none")
    how = f"of {len(cases)}, Linux {kernel}" + ("" if whole else "; the guest ended early")
    if failed:
        how += "; " + ", ".join(failed)
    missing = 0 if whole and cases else 1
    rows = tuple(
        (line["case"], name, f"{value:.4g}" if isinstance(value, float) else str(value))
        for line in cases
        for name, value in line.get("measured", {}).items()
    )
    return [
        at_most("cases over a real USB stack that fail", len(failed) + missing, 0, "", how=how),
        Table("Measurements in the guest", ("case", "what", "value"), rows),
    ]
