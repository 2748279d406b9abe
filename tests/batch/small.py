"""Small recordings on disk for the tests of batches, and work for engines."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import numpy as np

from heli3dof.recording.recording import recording_of_arrays
from heli3dof.recording.write import write_recording
from heli3dof.rig.profile import default_profile


def write_small(path: Path, *, rig: str = "K1", plan: str = "rich", roll_deg: float = 10.0) -> Path:
    """A recording of one second at 500 Hz: the roll angle rises from 0 to ``roll_deg``."""
    profile = default_profile().model_copy(update={"name": rig})
    t = np.arange(500) * 0.002
    angle = np.zeros((500, 3))
    angle[:, 0] = np.deg2rad(roll_deg) * t / t[-1]
    voltage = np.full((500, 2), 7.456) + np.sin(t)[:, None]
    meta = {"name": path.stem, "plan": {"name": plan}, "started_utc": "2026-03-02T09:00:00+00:00"}
    return write_recording(recording_of_arrays(t, voltage, angle, profile, meta=meta), path)


def square(x: int) -> int:
    return x * x


def square_later(x: int) -> int:
    """The first items take longest, so that they finish in another order."""
    time.sleep(0.05 * (4 - x) if x < 4 else 0)
    return x * x


def dies_once(path: str) -> str:
    """Kill the worker at the first try; a file remembers it."""
    if not Path(path).exists():
        Path(path).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return "done"


def dies_always(x: int) -> int:
    if x == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return x


def fails(x: int) -> int:
    raise ValueError("no such number")
