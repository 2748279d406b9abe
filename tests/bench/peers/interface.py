"""Writes and reads the two files between the benchmark and a peer: the task and the model.

``kind`` is one of four forms of a model:

``discrete``     x[k+1] = A x[k] + B (u[k] − u0) + K e[k],  y[k] = C x[k] + D (u[k] − u0) + y0
                 + e[k], samples every ``interval_s``, u[k] the mean voltage over [k, k+1),
                 cov e = S
``continuous``   ẋ = A x + B u + c,  y = C x
``exact``        as ``discrete``, at the control rate and without D: heli3dof's methods
``physical``     `rigid.NAMES` with values and standard deviations (NaN where the peer has none)

Every model comes with the CPU time of the fit alone (no import, no reading), the peak memory of
the fitting process, and the tool's setting as text.
"""

from __future__ import annotations

import re
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

PROC_STATUS = Path("/proc/self/status")


@dataclass(frozen=True, eq=False)
class Task:
    """One uninterrupted flight from rest, N samples, and the known numbers of the rig."""

    t: np.ndarray
    """(N,) s"""
    voltage: np.ndarray
    """(N, 2) V; row k is held from sample k to k + 1"""
    angle: np.ndarray
    """(N, 3) rad; row k is measured before voltage k acts"""
    nominal: np.ndarray
    """(len(rigid.NAMES),): start values of physical fits, in the order of `rigid.NAMES`."""
    known: np.ndarray
    """(len(rigid.KNOWN),): the known constants, in the order of `rigid.KNOWN`."""
    rad_per_count: np.ndarray
    """(3,) rad"""
    acceleration_noise: np.ndarray
    """(3,) rad/s² per √Hz: the true intensity of the random accelerations."""

    @property
    def dt(self) -> float:
        """The sample period in s."""
        return float(np.median(np.diff(self.t)))


def write_task(path: Path, task: Task) -> None:
    np.savez(path, **{f.name: getattr(task, f.name) for f in fields(task)})


def read_task(path: Path) -> Task:
    with np.load(path) as kept:
        return Task(**{f.name: kept[f.name] for f in fields(Task)})


@dataclass
class Meter:
    """Measures CPU time and peak memory of a fit in this process."""

    cpu_s: float = np.nan
    peak_MB: float = np.nan

    @contextmanager
    def fitting(self) -> Iterator[None]:
        start = time.process_time()
        yield
        self.cpu_s = time.process_time() - start
        self.peak_MB = peak_MB()


def peak_MB(status: str = "") -> float:
    """Returns this process's peak memory by /proc/self/status; NaN if that is missing (not Linux).

    getrusage is not suitable: a child starts with the peak of its parent. ``status``: the file's
    text, for tests.
    """
    if not status and PROC_STATUS.exists():
        status = PROC_STATUS.read_text(encoding="ascii")
    found = re.search(r"VmHWM:\s*(\d+) kB", status)
    return int(found[1]) / 1024 if found else np.nan


@dataclass(frozen=True, eq=False)
class Found:
    """The model of a peer, as written to its file."""

    kind: str
    setting: str
    cpu_s: float
    peak_MB: float
    arrays: Mapping[str, np.ndarray] = field(default_factory=dict)


def write_linear(
    path: Path, meter: Meter, setting: str, *, interval_s: float = 0.0, **arrays: Any
) -> None:
    """Write A, B, C and, if present, D, K, S, u0, y0, c; ``interval_s`` 0: a continuous model."""
    kind = "discrete" if interval_s else "continuous"
    _write(path, kind, meter, setting, interval_s=interval_s, **arrays)


def write_exact(path: Path, meter: Meter, setting: str, **arrays: Any) -> None:
    """Write A, B, C, K, S, u0, y0 of a `LinearModel`, and its poles.

    The poles are (n, 4) in 1/s: real part, imaginary part, and their standard deviations.
    """
    _write(path, "exact", meter, setting, **arrays)


def write_physical(
    path: Path,
    meter: Meter,
    setting: str,
    values: np.ndarray,
    stds: np.ndarray,
    model_file: str = "",
) -> None:
    """Write the ten parameters of `rigid.NAMES` with their standard deviations.

    ``model_file``: a heli3dof model with further parameters, used for the replay instead.
    """
    more = {"model_file": model_file} if model_file else {}
    _write(path, "physical", meter, setting, values=values, stds=stds, **more)


def _write(path: Path, kind: str, meter: Meter, setting: str, **arrays: Any) -> None:
    np.savez(path, kind=kind, setting=setting, cpu_s=meter.cpu_s, peak_MB=meter.peak_MB, **arrays)


def read_found(path: Path) -> Found:
    head = ("kind", "setting", "cpu_s", "peak_MB")
    with np.load(path) as kept:
        arrays = {name: kept[name] for name in kept.files if name not in head}
        return Found(
            str(kept["kind"]),
            str(kept["setting"]),
            float(kept["cpu_s"]),
            float(kept["peak_MB"]),
            arrays,
        )
