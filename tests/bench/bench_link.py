"""Measures the link: what damaged frames cause, and round-trip times."""

from __future__ import annotations

import os
import time
from collections import Counter

from heli3dof_drivers.link.rig import LinkRig

from heli3dof.experiment.control_loop.realtime_priority import realtime
from heli3dof.rig.drivers import open_driver
from heli3dof.rig.interface import Command
from heli3dof.rig.profile import TABLE_I, profile_from_dict
from tests.bench import Figure, at_least, at_most
from tests.drivers.emulated_rigs import RigProcess, firmware_rig
from tests.drivers.firmware.building import run
from tests.drivers.link.faults import KINDS, Tally, Trial

TITLE = "The link"
INTRO = (
    "Damage: half of all frames in both directions have bit errors, a burst error, a missing "
    "piece or inserted noise, or are repeated, delayed or lost. The emulated device, the host and "
    "the C firmware read them; the bench compares the accepted frames with those sent. Round "
    "trip: POLL to SAMPLE in a loop with commands, timed by the host, through pyserial to the C "
    "firmware behind a pseudo-terminal. Flights over that line: the bench `loop`."
)
FAULTS = int(os.environ.get("LINK_FAULTS", "1200000"))
SEEDS = 4
SECONDS = float(os.environ.get("LINK_SECONDS", "60"))
MEDIAN_US = 150.0


def measure() -> list[Figure]:
    figures = damaged()
    with firmware_rig() as rig_process:
        for rate_hz in (500.0, 1000.0):
            figures.append(polled(rig_process, rate_hz))
    return figures


def damaged() -> list[Figure]:
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
        at_least("damaged frames", total("faults"), 1e6, "", how=how),
        at_most(
            "wrong commands accepted", total("wrong_commands"), 0, "", how=f"of {total('commands')}"
        ),
        at_most(
            "wrong armings accepted", total("wrong_armings"), 0, "", how=f"of {total('armings')}"
        ),
        at_most(
            "wrong samples accepted", total("wrong_samples"), 0, "", how=f"of {total('samples')}"
        ),
        at_most(
            "second valid frame after damage not received", total("unsynchronised"), 0, "",
            how=f"of {total('resyncs')}",
        ),
        at_most(
            "replies in which the C firmware differs", different, 0, "",
            how=f"of {answers}, byte by byte, to the same damaged input",
        ),
    ]  # fmt: skip


def against_the_firmware(trial: Trial) -> tuple[int, int]:
    """Returns the number of the emulated device's replies, and of those the firmware differs in."""
    sent = "".join(f"{now} > {data.hex()}\n" for now, data, _ in trial.script)
    expected = [
        f"{now} < {piece.hex()}00"
        for now, _, answer in trial.script
        for piece in answer.split(b"\0")[:-1]
    ]
    answered = run("heli3dof-replay", text=sent)
    different = sum(a != b for a, b in zip(expected, answered, strict=False))
    return len(expected), different + abs(len(expected) - len(answered))


def polled(rig_process: RigProcess, rate_hz: float) -> Figure:
    """Measures round-trip times in polled mode, where the host keeps time."""
    profile = profile_from_dict({**TABLE_I, "loop": {"rate_hz": rate_hz}})
    rig = open_driver(rig_process.url("stream=0"), profile)
    assert isinstance(rig, LinkRig)
    with realtime() as granted:
        rig.arm()
        due = time.monotonic()
        for k in range(1, round(SECONDS * rate_hz) + 1):
            late = (time.monotonic() - due) / profile.dt
            due += profile.dt * max(1, int(late) + 1)
            rig.exchange(Command(k, 1.0, 1.0), due)
    rig.close()
    counted = rig.statistics
    trip = counted.round_trip
    median, p999 = 1e6 * trip.quantile_s(0.5), 1e6 * trip.quantile_s(0.999)
    scheduling = "real-time" if granted.scheduled else "ordinary"
    return Figure(
        f"{rate_hz:g} Hz: round trip, median / 99.9 %",
        f"{median:.0f} / {p999:.0f} µs",
        f"median ≤ {MEDIAN_US:g} µs",
        median <= MEDIAN_US,
        how=f"{trip.n} polls, {scheduling} scheduling, worst {1e3 * trip.worst_s:.2g} ms; "
        f"{counted.retries} retries, {counted.lost} lost, {counted.malformed} malformed",
    )
