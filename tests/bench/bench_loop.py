"""Measures the punctuality of the control loop in real time.

Run it on an idle machine. FLIGHT_SECONDS in the environment sets the length of a flight.
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
    "`heli3dof run-step` in its own process, with recorder and live view on a pseudo-terminal, "
    "against the C firmware on another one (`serial://`, the device keeps time). Lateness of a "
    "sample: its arrival minus its instant on the device's clock, mapped to the host's clock, "
    "minus the smallest such delay. A period is late if its lateness exceeds 1 ms or if it was "
    "missed. A gap in the sample numbers is a loss on the line; a jump of the device's time "
    "without a gap is a sample that the device skipped because its process was delayed. *Without "
    "privileges*: neither SCHED_FIFO nor locked memory. Kernel workers carry the bytes of a "
    "pseudo-terminal. With real-time scheduling and CAP_SYS_NICE, as here, the loop raises their "
    "priority as well. The firmware runs on other cores than the flight, as a real device does. "
    "*Over TCP*: the same firmware and loop without those workers. In the same run, "
    "processes of the highest priority detect host stalls on every core."
)
SECONDS = float(os.environ.get("FLIGHT_SECONDS", "60"))


class Kind(NamedTuple):
    """The conditions of one flight of this benchmark."""

    rate_hz: int
    granted: bool
    tcp: bool = False

    @property
    def seconds(self) -> float:
        """Duration of the flight in s; shorter at 1 kHz, which has no required values."""
        return SECONDS if self.rate_hz == 500 else SECONDS / 2


KINDS = (
    Kind(500, True), Kind(500, False), Kind(500, True, tcp=True), Kind(1000, True),
    Kind(1000, False),
)  # fmt: skip


def measure() -> list[Figure | Table]:
    program = rig_program()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        flights = {kind: fly(program, folder, kind) for kind in KINDS}
    return [*punctual(flights), side_by_side(flights)]


def fly(program: str, folder: Path, kind: Kind) -> dict[str, Any]:
    """Fly once; returns the run's JSON document and the causes of late periods.

    The profile's limits and the watchdog tolerate host stalls.
    """
    rate_hz, granted, tcp = kind
    name = f"{rate_hz}-{granted}-{tcp}"
    profile = write_profile(folder / f"{rate_hz}.toml", rate_hz=rate_hz, **PATIENT)
    output, log = (folder / f"{name}.{suffix}" for suffix in ("mcap", "late"))
    transport = ("--tcp", "0") if tcp else ()
    # A real device has its own processor: use neither the first core (the flight's) nor the last.
    apart = sorted(os.sched_getaffinity(0))[1:-1]
    options = ("--watchdog", "500", "--late", str(log), *transport)
    without = ("permissions",) * (not granted)
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
    """Returns the longest delay (s) of a sample by the firmware's own process."""
    rig: Any = open_driver(device, load_profile(profile))
    try:
        return float(rig.report().late_us) * 1e-6
    finally:
        rig.close()


def punctual(flights: dict[Kind, dict[str, Any]]) -> list[Figure]:
    """Returns the figures at 500 Hz: late periods by cause, and samples lost on the line."""
    figures = []
    for kind, result in flights.items():
        if kind.rate_hz != 500:
            continue
        granted, bar = kind.granted, 0.0 if kind.granted else 0.1
        assert result["realtime"]["scheduled"] is granted, "this machine grants no SCHED_FIFO"
        what = "with real-time scheduling" if granted else "without privileges"
        what += ", over TCP" * kind.tcp
        what = f"500 Hz, {what}"
        reason: Lateness = result["why_late"]
        stalls, seconds = result["stalls"], reason.periods / 500
        figures += [
            at_most(
                f"{what}: late by more than 1 ms", 100 * result["punctuality"]["late_share"], bar,
                "%", how=f"{reason.late} periods",
            ),
            Figure(
                f"{what}: of these, during host stalls", f"{reason.stalled}", "", None,
                f"{len(stalls.seen)} stalls, longest {1e3 * stalls.worst_s:.0f} ms, "
                f"{100 * stalls.together_s / seconds:.2g} % of the time",
            ),
            Figure(
                f"{what}: of these, written late by the firmware", f"{reason.device}", "", None,
                "its process was delayed between reading the encoders and writing",
            ),
            at_most(
                f"{what}: late for another reason", 100 * reason.own / reason.periods, bar, "%",
                how=f"{reason.own_times} times, longest {1e3 * reason.own_worst_s:.2f} ms",
            ),
            at_most(f"{what}: samples lost on the line", result["lost_periods"], 0, ""),
            Figure(
                f"{what}: skipped by the device, missed by the host",
                f"{result['left_out_periods']}, {result['missed_periods']}", "", None,
                "largest lateness of the firmware's process: "
                f"{1e3 * result['device_late_s']:.2f} ms",
            ),
        ]  # fmt: skip
    return figures


def side_by_side(flights: dict[Kind, dict[str, Any]]) -> Table:
    """Returns a table with the lateness quantiles of every flight."""
    rows = []
    for kind, result in flights.items():
        p = result["punctuality"]
        late = (p["median_s"], p["p99_s"], p["p999_s"], p["worst_s"])
        turn = (p["turnaround_median_s"], p["turnaround_p999_s"])
        rows.append(
            (
                f"{kind.rate_hz} Hz" + ", TCP" * kind.tcp,
                "all" if kind.granted else "none",
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
            "rate", "privileges", "periods", "lateness: median / 99 % / 99.9 % / worst", "late",
            "lost / skipped / missed", "turnaround: median / 99.9 %",
            "by the device's clock",
            "lateness of the firmware, worst",
        ),
        tuple(rows),
    )  # fmt: skip


def _us(seconds: float) -> str:
    return f"{seconds * 1e6:.0f}"
