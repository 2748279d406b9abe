"""Measures the time to record a period and to read a recording, and data lost by kill -9."""

from __future__ import annotations

import random
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from heli3dof.recording.mcap_files.reader import read_recording
from heli3dof.recording.mcap_files.recover import recover
from tests.bench import Figure, at_most
from tests.recording.bench import append_seconds, read_seconds

TITLE = "Recording"
KILLS = 10
HELI3DOF = [sys.executable, "-m", "heli3dof"]
DEVICE = "mock:?watchdog_s=5"
"""A long watchdog: on a busy machine the flight must last until it is killed."""
SEED = 1


def lost_after_kill(folder: Path, after_s: float) -> float:
    """Returns s of data lost when a real-time flight gets kill -9 after ``after_s`` s."""
    path = folder / f"killed-{after_s:.3f}.mcap"
    flight = subprocess.Popen(
        [*HELI3DOF, "run-step", "--roll", "5", "--device", DEVICE, "-o", str(path)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    while not (path.exists() and path.stat().st_size > 20_000):
        time.sleep(0.01)
    time.sleep(after_s)
    flight.send_signal(signal.SIGKILL)
    killed = time.time()
    flight.wait()
    saved = read_recording(recover(path).path)
    return killed - (saved.meta["start_ns"] / 1e9 + float(saved.t[-1]))


def measure() -> list[Figure]:
    draw = random.Random(SEED)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        appends = append_seconds(folder / "ticks.mcap")
        reads = read_seconds(folder / "read.mcap")
        losses = [lost_after_kill(folder, draw.uniform(0.2, 2.0)) for _ in range(KILLS)]
    return [
        at_most(
            "recorder: time per period, median", statistics.median(appends) * 1e6, 10, "µs",
            how=f"{len(appends)} periods, the recorder's thread running",
        ),
        at_most(
            "reading 60 s at 500 Hz into arrays, median", statistics.median(reads) * 1e3, 50, "ms",
            how=f"{len(reads)} reads of one file",
        ),
        at_most(
            "lost by `kill -9`, worst", max(losses), 0.5, "s",
            how=f"{KILLS} real-time flights killed at random moments, seed {SEED}, then `recover`",
        ),
    ]  # fmt: skip
