"""Measures the run times of short commands."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tests.bench import Figure, at_most

TITLE = "The command line"
HELI3DOF = str(Path(sys.executable).parent / "heli3dof")


def seconds(*arguments: str) -> float:
    """Returns the run time of one command.

    The command has its own runtime folder, so that its estop does not reach other flights.
    """
    with tempfile.TemporaryDirectory(prefix="h3b-") as own:
        return _seconds(arguments, {**os.environ, "XDG_RUNTIME_DIR": own})


def _seconds(arguments: tuple[str, ...], environment: dict[str, str]) -> float:
    start = time.perf_counter()
    # estop without a rig ends with exit code 3, after the same steps
    subprocess.run([HELI3DOF, *arguments], check=False, capture_output=True, env=environment)
    return time.perf_counter() - start


def measure() -> list[Figure]:
    return [waited(*words) for words in (("--help",), ("devices",), ("estop", "--device", "mock:"))]


def waited(*words: str) -> Figure:
    """Returns the run time of a command's whole process, from start to exit."""
    seconds(*words)  # the first run compiles bytecode
    times = [seconds(*words) for _ in range(10)]
    shown = " ".join(words).removesuffix(" --device mock:")
    return at_most(
        f"`heli3dof {shown}`", statistics.median(times), 0.25, "s",
        how=f"median of 10 processes, {min(times):.3f} to {max(times):.3f} s",
    )  # fmt: skip
