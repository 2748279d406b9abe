"""The link: harmed lines, and flights over a pseudo-terminal to the firmware in C."""

from __future__ import annotations

import ctypes
import os
import pty
import resource
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from heli3dof_drivers.link.rig import LinkRig

from heli3dof.experiment.realtime import realtime
from heli3dof.recording.reader import read_recording
from heli3dof.rig.drivers import open_rig
from heli3dof.rig.port import Command
from heli3dof.rig.profile import TABLE_I, profile_from_dict
from tests.bench import Figure, at_least, at_most
from tests.drivers.doors import Door, firmware_door
from tests.drivers.firmware.building import run
from tests.drivers.link.faults import KINDS, Tally, Trial

TITLE = "The link"
INTRO = (
    "Harm: half of all frames of both directions have wrong bits, a wrong run of bytes, a piece "
    "cut out, noise in them, come twice, late or never; the emulated device, the host's side and "
    "the firmware in C read them, and a judge knows what was sent. Flights: `heli3dof run` with "
    "its recorder and its live view against the firmware in C behind a pseudo-terminal; "
    "every tick counts, those that were skipped as late ones."
)
FAULTS = int(os.environ.get("LINK_FAULTS", "1200000"))
SEEDS = 4
SECONDS = float(os.environ.get("LINK_SECONDS", "60"))
POLLS_S = float(os.environ.get("LINK_POLLS_S", "20"))
CAP_IPC_LOCK, CAP_SYS_NICE, PR_CAPBSET_DROP = 14, 23, 24


def measure() -> list[Figure]:
    figures = harmed()
    with firmware_door() as door:
        for rate_hz in (500.0, 1000.0):
            for privileged in (True, False):
                figures += flown(door, rate_hz, privileged)
            figures += polled(door, rate_hz)
    return figures


def harmed() -> list[Figure]:
    tallies: list[Tally] = []
    answers = different = 0
    for seed in range(1, SEEDS + 1):
        trial = Trial(seed)
        tallies.append(trial.run(FAULTS // SEEDS))
        n, wrong = against_the_firmware(trial)
        answers, different = answers + n, different + wrong
    kinds = sum((t.harmed for t in tallies), Counter[str]())
    how = ", ".join(f"{kinds[k]} {k}" for k in KINDS)

    def total(name: str) -> int:
        return sum(getattr(t, name) for t in tallies)

    return [
        at_least("frames harmed", total("faults"), 1e6, "", how=how),
        at_most(
            "wrong commands taken", total("wrong_commands"), 0, "", how=f"of {total('commands')}"
        ),
        at_most(
            "wrong armings taken", total("wrong_armings"), 0, "", how=f"of {total('armings')}"
        ),
        at_most("wrong samples taken", total("wrong_samples"), 0, "", how=f"of {total('samples')}"),
        at_most(
            "second whole frame after harm not read", total("unsynchronised"), 0, "",
            how=f"of {total('resyncs')}",
        ),
        at_most(
            "answers in which the firmware in C differs", different, 0, "",
            how=f"of {answers}, byte by byte, to the same harmed bytes",
        ),
    ]  # fmt: skip


def against_the_firmware(trial: Trial) -> tuple[int, int]:
    """Answers of the emulated device, and those that the firmware's core gives otherwise."""
    said = "".join(f"{now} > {data.hex()}\n" for now, data, _ in trial.script)
    expected = [
        f"{now} < {piece.hex()}00"
        for now, _, answer in trial.script
        for piece in answer.split(b"\0")[:-1]
    ]
    answered = run("heli3dof-replay", text=said)
    different = sum(a != b for a, b in zip(expected, answered, strict=False))
    return len(expected), different + abs(len(expected) - len(answered))


def flown(door: Door, rate_hz: float, privileged: bool) -> list[Figure]:
    """One flight on the command line: late ticks, and samples that did not come."""
    details = fly(door, rate_hz, privileged)
    granted = bool((details["realtime"] or {}).get("scheduled"))
    how_scheduled = "real-time scheduling" if granted else "no privileges"
    what = f"{rate_hz:g} Hz, {how_scheduled}"
    timing = details["punctuality"]
    n = details["periods"] + details["missed"]
    bar = 0.0 if granted else 0.1
    how = (
        f"{n} ticks; late by {1e6 * timing['median_s']:.0f} µs at the median, "
        f"{1e6 * timing['p999_s']:.0f} at 99.9 %, {1e3 * details['worst_lateness_s']:.2g} ms at "
        f"most; {details['missed']} skipped; from sample to command "
        f"{1e6 * timing['turnaround_median_s']:.0f} µs"
    )
    share = 100 * timing["late_share"]
    if rate_hz == 500.0:
        return [
            at_most(f"{what}: ticks late by more than 1 ms", share, bar, "%", how=how),
            at_most(f"{what}: samples lost", details["lost"], 0, "", how=f"{details['ending']}"),
        ]
    return [
        Figure(f"{what}: ticks late by more than 1 ms", f"{share:.3g} %", how=how),
        Figure(f"{what}: samples lost", str(details["lost"]), how=f"{details['ending']}"),
    ]


def fly(door: Door, rate_hz: float, privileged: bool) -> dict[str, Any]:
    """``heli3dof run`` with a terminal to draw on; the outcome as the recording keeps it."""
    with tempfile.TemporaryDirectory() as folder:
        plan, profile, recording = (
            Path(folder) / name for name in ("hold.toml", "rig.toml", "flight.mcap")
        )
        plan.write_text(
            f'name = "hold"\n[[segment]]\nkind = "hold"\nduration_s = {SECONDS}\n',
            encoding="utf-8",
        )
        profile.write_text(_toml({**TABLE_I, "loop": {"rate_hz": rate_hz}}), encoding="utf-8")
        ours, theirs = pty.openpty()
        threading.Thread(target=_swallow, args=(ours,), daemon=True).start()
        heli3dof = Path(sys.executable).with_name("heli3dof")
        done = subprocess.run(
            [
                str(heli3dof), "run", str(plan), "--device", door.url(), "--profile", str(profile),
                "-o", str(recording),
            ],
            stdout=subprocess.DEVNULL,
            stderr=theirs,
            env={**os.environ, "TERM": "xterm", "COLUMNS": "100"},
            preexec_fn=None if privileged else _without_privileges,
        )  # fmt: skip
        os.close(theirs)
        details = dict(read_recording(recording).meta["outcome_details"])
        details["ending"] = f"exit code {done.returncode}"
        return details


def polled(door: Door, rate_hz: float) -> list[Figure]:
    """The host keeps time and asks for each sample: what a question and its answer take."""
    profile = profile_from_dict({**TABLE_I, "loop": {"rate_hz": rate_hz}})
    rig = open_rig(door.url("stream=0"), profile)
    assert isinstance(rig, LinkRig)
    with realtime():
        rig.arm()
        statistics = rig.statistics
        due = time.monotonic()
        for k in range(1, round(POLLS_S * rate_hz) + 1):
            late = (time.monotonic() - due) / profile.dt
            due += profile.dt * max(1, int(late) + 1)
            rig.exchange(Command(k, 1.0, 1.0), due)
    rig.close()
    trip = statistics.round_trip
    what = f"{rate_hz:g} Hz: round trip, median / 99.9 %"
    median, p999 = 1e6 * trip.quantile_s(0.5), 1e6 * trip.quantile_s(0.999)
    how = (
        f"{trip.n} questions, worst {1e3 * trip.worst_s:.2g} ms, {statistics.repeats} asked again, "
        f"{statistics.damaged} damaged"
    )
    if rate_hz != 500.0:
        return [Figure(what, f"{median:.0f} / {p999:.0f} µs", how=how)]
    return [
        Figure(
            what, f"{median:.0f} / {p999:.0f} µs", "median ≤ 150 µs", median <= 150.0, how=how
        )
    ]  # fmt: skip


def _without_privileges() -> None:
    """In the child: what an ordinary user without limits.d has."""
    resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
    resource.setrlimit(resource.RLIMIT_MEMLOCK, (0, 0))
    prctl: Callable[..., int] = ctypes.CDLL(None).prctl
    for capability in (CAP_IPC_LOCK, CAP_SYS_NICE):
        prctl(PR_CAPBSET_DROP, capability, 0, 0, 0)


def _swallow(fd: int) -> None:
    try:
        while os.read(fd, 4096):
            pass
    except OSError:
        os.close(fd)


def _toml(profile: dict[str, Any]) -> str:
    import json

    lines = [f"name = {json.dumps(profile['name'])}"]
    for section, values in profile.items():
        if isinstance(values, dict):
            lines += [f"[{section}]", *(f"{k} = {json.dumps(v)}" for k, v in values.items())]
    return "\n".join(lines) + "\n"
