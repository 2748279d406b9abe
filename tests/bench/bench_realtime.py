"""Compares the share of late periods with and without each measure for real time.

Environment: FLIGHTS, number of blocks (one flight per measure; at least 20 for a result), and
SECONDS, length of a flight. ``FLIGHTS=2 SECONDS=3 make bench TOPIC=realtime`` is a short run.
"""

from __future__ import annotations

import os
import random
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest

from tests.bench import Figure, Table
from tests.drivers.firmware.building import rig_program
from tests.profiles import PATIENT, START_S, write_profile
from tests.realtime.flight import RAMP_DOWN_S, FlightProcess, firmware

TITLE = "Measures for real time, each switched off"
SEED = 1531
FLIGHTS = int(os.environ.get("FLIGHTS", "20"))
SECONDS = float(os.environ.get("SECONDS", "10"))
DRAWS = 10_000
"""Bootstrap replications"""
MEASURES = {
    "scheduling": "SCHED_FIFO for the loop and its threads; without it `workers` does "
    "nothing either (`realtime_priority.py`)",
    "memory": "mlockall (`realtime_priority.py`)",
    "workers": "the kernel's unbound workers under SCHED_FIFO (`workers.py`)",
    "live view": "not a measure: what drawing the flight ten times a second costs",
}  # fmt: skip
"""Name in `tests.realtime.flight.WITHOUT` → description of the measure"""
INTRO = (
    "`heli3dof run-step` at 500 Hz in a process of its own, with recorder and live view, against "
    "the C firmware on a pseudo-terminal (emulated rig, the device keeps time). A block is one "
    "flight with every measure on and one flight without each measure, in random order "
    f"(seed {SEED}). A pair is the two flights of one block. A period is late if its sample "
    "arrives more than 1 ms after its deadline; missed periods count as late. Ratio: mean share "
    "of late periods without the measure over that with it, 95 % interval by bootstrap over the "
    "pairs. A measure reduces lateness if the whole interval lies above 1."
)


def measure() -> list[Figure | Table]:
    shares = late_shares(FLIGHTS, SECONDS)
    figures = [
        Figure(f"without {name}: {what}", *_ratio_cells(shares[""], shares[name]))
        for name, what in MEASURES.items()
    ]
    rows = [
        (f"without {name}" if name else "with every measure", *_quantiles(values))
        for name, values in shares.items()
    ]
    head = ("flights", "mean", "median", "worst", "flights without a late period")
    caption = f"Share of late periods over {FLIGHTS} flights of {SECONDS:g} s each"
    return [*figures, Table(caption, head, tuple(rows))]


def late_shares(blocks: int, seconds: float) -> dict[str, np.ndarray]:
    """Returns measure switched off ("": none) → share of late periods (blocks,)."""
    draw = random.Random(SEED)
    shares: dict[str, list[float]] = {name: [] for name in ("", *MEASURES)}
    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_RUNTIME_DIR", folder)  # `heli3dof estop` elsewhere must not stop these
        for block in range(blocks):
            order = list(shares)
            draw.shuffle(order)
            for name in order:
                shares[name].append(late_share(Path(folder), name, seconds))
            shown = ", ".join(f"{k or 'all on'} {100 * v[-1]:.3g} %" for k, v in shares.items())
            print(f"block {block + 1} of {blocks}: {shown}", file=sys.stderr, flush=True)
    return {name: np.array(values) for name, values in shares.items()}


def late_share(folder: Path, off: str, seconds: float) -> float:
    """Returns the share of late periods in one flight without the measure ``off``."""
    profile = write_profile(folder / "rig.toml", **PATIENT)
    with (
        firmware(rig_program(), "--watchdog", "500") as device,
        FlightProcess(
            device, folder / "flight.mcap", seconds, profile=profile, without=[off] if off else []
        ) as flight,
    ):
        document = flight.result(seconds + RAMP_DOWN_S + START_S)
    return float(document["punctuality"]["late_share"])


def ratio(
    on: np.ndarray, off: np.ndarray, *, draws: int = DRAWS, seed: int = SEED
) -> tuple[float, float, float]:
    """Returns mean(off)/mean(on) of the pairs (n,) and its 95 % percentile bootstrap interval.

    Infinite where no period was late with the measure on; NaN where none was late either way.
    """
    picks = np.random.default_rng(seed).integers(0, len(on), (draws, len(on)))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = off[picks].mean(axis=1) / on[picks].mean(axis=1)
        point = np.divide(off.mean(), on.mean())
    # Quantiles without interpolation, because an interval may end at infinity.
    ratios = np.sort(ratios[~np.isnan(ratios)])
    if not len(ratios):
        return float(point), float("nan"), float("nan")
    low, high = ratios[int(0.025 * len(ratios))], ratios[int(np.ceil(0.975 * len(ratios))) - 1]
    return float(point), float(low), float(high)


def _ratio_cells(on: np.ndarray, off: np.ndarray) -> tuple[str, str, None, str]:
    point, low, high = ratio(on, off)
    shares = f"{100 * off.mean():.3g} % late without it, {100 * on.mean():.3g} % with it"
    return f"{point:.2f} times as many late ({low:.2f} to {high:.2f})", "", None, shares


def _quantiles(values: np.ndarray) -> tuple[str, ...]:
    shown = (values.mean(), np.median(values), values.max())
    return (*(f"{100 * v:.3g} %" for v in shown), f"{int((values == 0).sum())} of {len(values)}")
