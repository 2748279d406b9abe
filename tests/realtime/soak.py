"""Growth of the program's memory in a long flight.

Every `EVERY_S` the program's private pages (*anonymous*: heaps, stacks, buffers) are read from
/proc. A page once touched is mostly kept, so the readings x are a random walk rather than noise
about a line; the growth is the walk's mean step. With x_i the mean of the i-th of `BLOCKS`
stretches, each of length T, and d_i = x_i − x_(i−1):

    growth = mean(d) / T        95 %: ± c · s / (√n T)

    s² = γ_0 + 2 Σ_(j=1..L) (1 − j/(L+1)) γ_j        γ_j: autocovariance of d (Newey and West 1987)
    c  = 1.96 + 2.9694 b + 0.416 b² − 0.5324 b³      b = (L+1)/n (Kiefer and Vogelsang 2005)

Memory that comes and goes (γ_1 < 0) narrows the interval, memory that comes in runs widens it. The
*upper* end of the interval shows that memory does not grow; noise only raises it.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tests.profiles import PATIENT, write_profile
from tests.realtime.flight import RAMP_DOWN_S, FlightProcess

EVERY_S = 0.25
WARM_UP = 0.2
"""Share of the flight at its beginning that is not used: caches fill"""
BLOCKS = 24
LAGS = 3
"""L: 4 (n/100)^(2/9), upwards"""
CRITICAL = (-0.5324, 0.4160, 2.9694, 1.9600)
"""c's polynomial in b: s² is itself an estimate from few steps"""
RAMPS = b"ramping down"
"""The live view's text after the plan; afterwards the recording is read back"""


@dataclass(frozen=True)
class Soak:
    """Memory in a long flight."""

    minutes: float
    """Minutes of readings, without the warm-up"""
    flown_min: float
    """Minutes of all readings"""
    first_MiB: float
    last_MiB: float
    growth_KiB_per_min: float
    low: float
    """Lower end of the growth's 95 % interval"""
    high: float
    files_MiB: tuple[float, float]
    """Pages of files and libraries in memory, first and last"""
    flight: dict[str, Any]
    """The flight's own JSON document"""


def soak(device: str, folder: Path, seconds: float) -> Soak:
    """Fly for ``seconds`` with recorder and live view, and read the memory meanwhile.

    A flight that is cut short gives fewer readings; its document holds the reason.
    """
    profile = write_profile(folder / "soak.toml", duration_max_s=seconds + 60, **PATIENT)
    t: list[float] = []
    held: list[tuple[float, float]] = []
    with FlightProcess(device, folder / "soak.mcap", seconds, profile=profile) as flight:
        while b"flying" not in flight.shown and flight.process.poll() is None:
            time.sleep(0.05)
        start = time.monotonic()
        while (now := time.monotonic() - start) < seconds - 1 and RAMPS not in flight.shown:
            if flight.process.poll() is not None:
                break
            t.append(now)
            held.append(memory_KiB(flight.process.pid))
            time.sleep(EVERY_S)
        document = flight.ended(seconds + RAMP_DOWN_S + 120)
    return growth_of(np.array(t), np.array(held), document)


def growth_of(t_s: np.ndarray, held_KiB: np.ndarray, document: dict[str, Any]) -> Soak:
    """The growth of readings (N, 2), KiB at s, without the warm-up."""
    keep = t_s >= WARM_UP * t_s[-1]
    minutes, kept = t_s[keep] / 60, held_KiB[keep] / 1024
    growth, half = mean_step(minutes, kept[:, 0] * 1024)
    return Soak(
        float(minutes[-1] - minutes[0]), float(t_s[-1]) / 60, float(kept[0, 0]),
        float(kept[-1, 0]), growth, growth - half, growth + half,
        (float(kept[0, 1]), float(kept[-1, 1])), document,
    )  # fmt: skip


def mean_step(t: np.ndarray, x: np.ndarray) -> tuple[float, float]:
    """Growth of x (N,) at t (N,), per unit of t, and half its 95 % interval."""
    blocks = np.array_split(np.arange(len(x)), BLOCKS)
    steps = np.diff([x[b].mean() for b in blocks])
    length = np.diff([t[b].mean() for b in blocks]).mean()
    n, away = len(steps), steps - steps.mean()
    s2 = away @ away / n
    for lag in range(1, LAGS + 1):
        s2 += 2 * (1 - lag / (LAGS + 1)) * (away[lag:] @ away[:-lag]) / n
    b = (LAGS + 1) / n
    critical = np.polyval(CRITICAL, b)
    half = critical * np.sqrt(max(0.0, s2) / n)
    return float(steps.mean() / length), float(half / length)


def memory_KiB(pid: int) -> tuple[float, float]:
    """KiB of a process: private pages, and pages of files in memory."""
    lines = Path(f"/proc/{pid}/smaps_rollup").read_text(encoding="ascii").splitlines()[1:]
    of = {name: float(value.split()[0]) for name, value in (line.split(":") for line in lines)}
    return of["Anonymous"], of["Rss"] - of["Anonymous"]
