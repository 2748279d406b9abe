"""How long a person waits for the command line."""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
from pathlib import Path

from tests.bench import Figure, at_most

TITLE = "The command line"
HELI3DOF = str(Path(sys.executable).parent / "heli3dof")


def seconds(*arguments: str) -> float:
    start = time.perf_counter()
    subprocess.run([HELI3DOF, *arguments], check=True, capture_output=True)
    return time.perf_counter() - start


def measure() -> list[Figure]:
    seconds("--help")  # the first run compiles bytecode
    times = [seconds("--help") for _ in range(10)]
    spread = f"{min(times):.3f} to {max(times):.3f} s"
    return [
        at_most(
            "`heli3dof --help`", statistics.median(times), 0.25, "s",
            how=f"median of 10 processes, {spread}",
        )
    ]  # fmt: skip
