"""The loop in real time: punctuality.

To be run on a quiet machine. FLIGHT_SECONDS in the environment shortens it; kill -9 and power cuts
are `bench_kill`, the half hour without growth of memory is `bench_soak`.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

from heli3dof.recording.mcap_files.reader import read_recording
from heli3dof.rig.drivers import open_driver
from heli3dof.rig.profile import load_profile
from tests.bench import Figure, Table, at_most
from tests.drivers.firmware.building import rig_program
from tests.profiles import PATIENT, write_profile
from tests.realtime.flight import RAMP_DOWN_S, FlightProcess, firmware
from tests.realtime.host_stalls import Lateness, host_stalls, lateness, written_late

TITLE = "The loop"
INTRO = (
    "`heli3dof run-step` in a process of its own, recording to a file and with its live view on a "
    "pseudo-terminal, against the C firmware on another (`serial://`, the device keeps time). "
    "Lateness is the arrival of a sample after its instant on the device's clock, mapped to the "
    "host's, beyond the quickest that came; late is more than 1 ms, and every missed period counts "
    "as late too. A gap in the samples' numbers was lost on the line; a jump of the device's time "
    "without one was left out by the device, whose process was held up. *Nothing granted*: no "
    "SCHED_FIFO and no locked memory, as for a user without permission for either. What a "
    "pseudo-terminal carries passes through workers of the kernel: ordinary threads, but where "
    "the loop is scheduled in real time and may (CAP_SYS_NICE, as here) it has them scheduled so, "
    "too. The firmware has neither the flight's core nor the first, which is let sleep: a device "
    "has a processor of its own. *Cores let sleep*: without what keeps a virtual machine's others "
    "awake in flight, in the same run. *Over TCP* is the same firmware and the same loop without "
    "those workers. Processes above all others watch every core for the machine's standstills in "
    "the same run: a virtual machine is not always given its processors."
)
SECONDS = float(os.environ.get("FLIGHT_SECONDS", "60"))


class Kind(NamedTuple):
    """One flight of the bench."""

    rate_hz: int
    granted: bool
    tcp: bool = False
    awake: bool = True
    """False: a virtual machine's cores are let fall asleep"""

    @property
    def seconds(self) -> float:
        """1 kHz is reported, and has no bars."""
        return SECONDS if self.rate_hz == 500 else SECONDS / 2


KINDS = (
    Kind(500, True), Kind(500, True, awake=False), Kind(500, False),
    Kind(500, False, awake=False), Kind(500, True, tcp=True), Kind(1000, True), Kind(1000, False),
)  # fmt: skip


def measure() -> list[Figure | Table]:
    program = rig_program()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        flights = {kind: fly(program, folder, kind) for kind in KINDS}
    return [*punctual(flights), side_by_side(flights)]


def fly(program: str, folder: Path, kind: Kind) -> dict[str, Any]:
    """One flight's JSON document; limits and watchdog bear a machine that stands still."""
    rate_hz, granted, tcp, awake = kind
    name = f"{rate_hz}-{granted}-{tcp}-{awake}"
    profile = write_profile(folder / f"{rate_hz}.toml", rate_hz=rate_hz, **PATIENT)
    output, log = (folder / f"{name}.{suffix}" for suffix in ("mcap", "late"))
    transport = ("--tcp", "0") if tcp else ()
    # A device has a processor of its own: neither the flight's core nor the one that may sleep.
    apart = sorted(os.sched_getaffinity(0))[1:-1]
    options = ("--watchdog", "500", "--late", str(log), *transport)
    without = ("permissions",) * (not granted) + ("awake",) * (not awake)
    with firmware(program, *options, cores=apart) as device:
        with (
            host_stalls() as stalls,
            FlightProcess(device, output, kind.seconds, profile=profile, without=without) as flight,
        ):
            document = flight.result(kind.seconds + RAMP_DOWN_S + 120)
        return {
            **document,
            "why_late": lateness(read_recording(output), stalls, written_late(log)),
            "stalls": stalls,
            "device_late_s": device_late_s(device, profile),
        }


def device_late_s(device: str, profile: Path) -> float:
    """The worst lateness of the firmware's own process."""
    rig: Any = open_driver(device, load_profile(profile))
    try:
        return float(rig.report().late_us) * 1e-6
    finally:
        rig.close()


def punctual(flights: dict[Kind, dict[str, Any]]) -> list[Figure]:
    """The bars at 500 Hz: how late and why, and nothing lost on the line."""
    figures = []
    for kind, result in flights.items():
        if kind.rate_hz != 500 or not kind.awake:
            continue
        granted, bar = kind.granted, 0.0 if kind.granted else 0.1
        assert result["realtime"]["scheduled"] is granted, "this machine grants no SCHED_FIFO"
        what = "with real-time scheduling" if granted else "nothing granted"
        what += ", over TCP instead" * kind.tcp
        what = f"500 Hz, {what}"
        reason: Lateness = result["why_late"]
        stalls, seconds = result["stalls"], reason.periods / 500
        figures += [
            at_most(
                f"{what}: late by more than 1 ms", 100 * result["punctuality"]["late_share"], bar,
                "%", how=f"{reason.late} periods",
            ),
            Figure(
                f"{what}: of these, while the machine stood still", f"{reason.stalled}", "", None,
                f"it did so {len(stalls.seen)} times, {1e3 * stalls.worst_s:.0f} ms at worst, "
                f"{100 * stalls.together_s / seconds:.2g} % of the time",
            ),
            Figure(
                f"{what}: of these, written late by the firmware", f"{reason.device}", "", None,
                "its process was held up between reading the encoders and writing",
            ),
            at_most(
                f"{what}: late for neither reason", 100 * reason.own / reason.periods, bar, "%",
                how=f"{reason.own_times} times, {1e3 * reason.own_worst_s:.2f} ms at worst",
            ),
            at_most(f"{what}: samples lost on the line", result["lost_periods"], 0, ""),
            Figure(
                f"{what}: left out by the device, missed by the host",
                f"{result['left_out_periods']}, {result['missed_periods']}", "", None,
                f"the firmware's process late by {1e3 * result['device_late_s']:.2f} ms at worst",
            ),
        ]  # fmt: skip
    return figures


def side_by_side(flights: dict[Kind, dict[str, Any]]) -> Table:
    """Every flight's quantiles."""
    rows = []
    for kind, result in flights.items():
        p = result["punctuality"]
        late = (p["median_s"], p["p99_s"], p["p999_s"], p["worst_s"])
        turn = (p["turnaround_median_s"], p["turnaround_p999_s"])
        rows.append(
            (
                f"{kind.rate_hz} Hz" + ", TCP" * kind.tcp + ", cores let sleep" * (not kind.awake),
                "all" if kind.granted else "nothing",
                str(result["periods"]),
                " / ".join(_us(v) for v in late),
                f"{100 * p['late_share']:.3g} %",
                " / ".join(str(result[f"{w}_periods"]) for w in ("lost", "left_out", "missed")),
                " / ".join(_us(v) for v in turn),
                " / ".join(_us(result["link"][f"delay_{q}_s"]) for q in ("median", "p999")),
                _us(result["device_late_s"]),
            )
        )
    return Table(
        f"{SECONDS:g} s each, at 1 kHz half of it; µs",
        (
            "rate", "granted", "periods", "lateness: median / 99 % / 99.9 % / worst", "late",
            "lost / left out / missed", "sample to command: median / 99.9 %",
            "by the device's clock",
            "firmware itself late, worst",
        ),
        tuple(rows),
    )  # fmt: skip


def _us(seconds: float) -> str:
    return f"{seconds * 1e6:.0f}"
