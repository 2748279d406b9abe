"""Flies under random sequences of device faults; counts crashes and motors not at zero."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor

from tests.bench import Figure, Table, at_most
from tests.drivers.firmware.building import COMPILER
from tests.safety.misbehaviour import Result, emulated, endings, firmware

TITLE = "Devices that misbehave"
INTRO = (
    "Each sequence is one flight (take-off, step, landing) under one to four random faults from "
    "opening to landing. On the emulated device these are frames lost, repeated, torn, replayed or "
    "delayed, fields of right frames with random values, encoders and clocks that freeze, jump, "
    "wrap or run backwards, restarts, stops and cut lines; streamed and polled in turn, on a "
    "virtual clock. The C firmware flies in real time with its own fault switches, halted or "
    "killed at a random moment, recorded in a file."
)
SEQUENCES = int(os.environ.get("MISBEHAVIOUR_SEQUENCES", "1000"))
FIRMWARE_SHARE = 0.2
"""Share of the sequences run on the firmware: its real time takes ten times the virtual clock's"""
WORKERS = 2
SHOWN = 2000
"""Number of characters of a failure that are printed"""


def measure() -> list[Figure | Table]:
    n_firmware = round(SEQUENCES * FIRMWARE_SHARE) if COMPILER else 0
    on = {
        "emulated device": _run(emulated, range(SEQUENCES - n_firmware)),
        "C firmware": _run(firmware, range(n_firmware)),
    }
    every = [r for results in on.values() for r in results]
    wrong = [w for r in every for w in r.wrong]
    how = f"{len(every)} sequences, {len({r.seed for r in every if r.wrong})} with a failure"

    def count(*starts: str) -> int:
        return sum(w.startswith(starts) for w in wrong)

    return [
        at_most("crashes", count("crash"), 0, "", how=how),
        at_most('"an internal error"', count("an internal error", "interrupted"), 0, "", how=how),
        at_most("motors not at zero", count("motors", "a watchdog"), 0, "", how=how),
        at_most("errors without a cause or a fix", count("missing cause"), 0, "", how=how),
        Table(
            "How the flights ended",
            ("device", "sequences", "endings"),
            tuple((name, str(len(rs)), endings(rs)) for name, rs in on.items() if rs),
        ),
    ]


def _run(one: Callable[[int], Result], seeds: Iterable[int]) -> list[Result]:
    results = []
    with ProcessPoolExecutor(WORKERS) as pool:
        for result in pool.map(one, seeds, chunksize=5):
            results.append(result)
            for wrong in result.wrong:
                print(result.seed, result.faults, wrong[-SHOWN:], file=sys.stderr)
    return results
