"""Lists the tools that are compared, and runs each fit in a process of its own."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from heli3dof.identification.methods import methods
from tests.bench.peers import flights, judge
from tests.bench.peers.interface import Task, read_task, write_task

ROOT = Path(__file__).parent.parent.parent.parent
PEERS_PYTHON = ROOT / ".venv-peers" / "bin" / "python"
TIME_LIMIT_S = 2400
KEPT = ROOT / "bench-out" / "peers"
"""Cache of slow fits, valid while flight and code are unchanged"""
VALIDATION = ("multisine", 101)
"""Plan and seed of the hold-out flight for `identify`, which then fits the whole other flight"""


@dataclass(frozen=True)
class Tool:
    """A row of the table, and how its process is started."""

    name: str
    module: str
    arguments: tuple[str, ...] = ()
    slow: bool = False
    starts_at_truth: bool = False

    @property
    def ours(self) -> bool:
        return self.module == "ours"

    def missing(self) -> str:
        """Why the tool cannot run here, else an empty string."""
        if self.ours:
            known = self.arguments[0] in methods()
            return "" if known else f"heli3dof has no method {self.arguments[0]!r} yet"
        if not PEERS_PYTHON.exists():
            return "its environment is not there: make bench-peers"
        if self.module == "octave_n4sid" and shutil.which("octave") is None:
            return "Octave is not installed here: apt install octave octave-control"
        return ""


GREYBOX = Tool("**heli3dof greybox**", "ours", ("greybox",))
OUTPUT_ERROR = Tool(
    "AeroID output error, started at the true parameters", "aeroid_fit", ("output_error",),
    slow=True, starts_at_truth=True,
)  # fmt: skip
FILTER_ERROR = Tool("AeroID filter error", "aeroid_fit", ("filter_error",), slow=True)
TOOLS = (
    GREYBOX,
    Tool("**heli3dof pem**", "ours", ("pem",)),
    Tool("**heli3dof pbsid**", "ours", ("pbsid",)),
    Tool("**heli3dof tf4** (the paper's form)", "ours", ("tf4",)),
    Tool("**heli3dof oe**", "ours", ("oe",)),
    Tool("Octave n4sid", "octave_n4sid"),
    Tool("ctrlsys (SLICOT IB01)", "ctrlsys_ib01"),
    Tool("PySINDy", "pysindy_regression"),
    OUTPUT_ERROR,
    FILTER_ERROR,
)


def prepare_task(plan: str, seed: int, folder: Path) -> None:
    """Fly, store the flight, and write the tasks from its longest usable run.

    There is one task for each set of start values: nominal and true.
    """
    recording = flights.fly(plan, seed, folder)
    run = max(judge.flights([recording]).train, key=lambda r: r.stop - r.start)
    rows = recording.rows(slice(run.start, run.stop))
    for name, start in (("nominal", flights.nominal()), ("truth", flights.truth())):
        task = Task(
            rows.t, rows.voltage, rows.angle, start, flights.known(),
            np.abs(recording.profile.encoder.rad_per_count), flights.acceleration_noise(),
        )  # fmt: skip
        write_task(folder / f"{plan}-{seed}-{name}.npz", task)


def run(tool: Tool, plan: str, seed: int, folder: Path) -> Path:
    """Fit in a process of its own; returns the model's file.

    Raises CalledProcessError or TimeoutExpired.
    """
    out = folder / f"{plan}-{seed}-{tool.module}-{'-'.join(tool.arguments)}.npz"
    if tool.ours:
        validation = folder / f"{VALIDATION[0]}-{VALIDATION[1]}.mcap"
        files = [folder / f"{plan}-{seed}.mcap", validation, out]
    else:
        start = "truth" if tool.starts_at_truth else "nominal"
        files = [folder / f"{plan}-{seed}-{start}.npz", out]
    kept = KEPT / f"{fingerprint(tool, files[0])}.npz"
    if tool.slow and kept.exists():
        return kept
    python = sys.executable if tool.ours else str(PEERS_PYTHON)
    threads = dict.fromkeys(
        ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
    )
    subprocess.run(
        [python, "-m", f"tests.bench.peers.{tool.module}", *tool.arguments, *map(str, files)],
        cwd=ROOT, env={**os.environ, **threads}, check=True, capture_output=True, text=True,
        timeout=TIME_LIMIT_S,
    )  # fmt: skip
    if tool.slow:
        KEPT.mkdir(parents=True, exist_ok=True)
        shutil.copy(out, kept)
    return out


def fingerprint(tool: Tool, task_file: Path) -> str:
    """Returns a hash of a peer's task, its code and the tools' versions: the key of a kept fit."""
    h = hashlib.sha256(" ".join(tool.arguments).encode())
    if not tool.ours:
        task = read_task(task_file)
        for name in sorted(vars(task)):
            h.update(np.ascontiguousarray(getattr(task, name)).tobytes())
    for name in (tool.module, "rigid", "sampling"):
        h.update((Path(__file__).parent / f"{name}.py").read_bytes())
    h.update((ROOT / "constraints-peers.txt").read_bytes())
    return h.hexdigest()[:16]
