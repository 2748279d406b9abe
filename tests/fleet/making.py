"""``python -m tests.fleet.making FOLDER``: write the results of a term with known changes.

Five rigs fly twice a week for twelve weeks; `CHANGES` lists what happened. Numbers are rounded like
those of a real batch.
"""

from __future__ import annotations

import csv
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

RIGS = tuple(f"rig-{i:02d}" for i in range(1, 6))
FLIGHTS = 24
START = datetime(2026, 9, 7, 10, 0, tzinfo=UTC)
# quantity: (mean, scatter between rigs, scatter between flights, standard deviation)
QUANTITIES = {
    "thrust_gain_ratio": (1.0, 0.01, 0.004, 0.004),
    "hover_voltage_V": (7.4, 0.05, 0.02, 0.02),
    "friction.viscous.yaw.damping_Nms_per_rad": (0.020, 0.001, 0.0006, 0.0008),
    "encoder.offset.roll.angle_deg": (0.0, 0.1, 0.03, 0.03),
    "motor.lag.time_constant_s": (0.080, 0.001, 0.002, 0.003),
}
STEP = ("rig-02", "thrust_gain_ratio", 14, -0.06)
"""From flight 14 on (from 0): a worn propeller"""
DRIFT = ("rig-04", "friction.viscous.yaw.damping_Nms_per_rad", 0.012)
"""Over the term: a bearing that wears"""
DEVIATING = ("rig-01", "encoder.offset.roll.angle_deg", 9, 1.5)
"""Only in flight 9: the beam was not level at the zero"""
DIFFERS = ("rig-05", "motor.lag.time_constant_s", 0.060)
"""Another amplifier than that of the siblings"""
BAD = {("rig-03", 4): (0, "", "clock.gaps"), ("rig-03", 20): (5, "the file is torn", "")}
"""(rig, flight) → exit code, error, faults"""


def term_rows(seed: int = 1) -> list[dict[str, Any]]:
    """Return the rows of the term."""
    rng = np.random.default_rng(seed)
    rows = []
    for rig in RIGS:
        level = {q: mean + between * rng.normal() for q, (mean, between, *_) in QUANTITIES.items()}
        for k in range(FLIGHTS):
            code, error, faults = BAD.get((rig, k), (0, "", ""))
            day = START + timedelta(days=7 * (k // 2) + 2 * (k % 2), minutes=7 * RIGS.index(rig))
            name = f"{rig}-{k:02d}"
            row: dict[str, Any] = {
                "recording": f"term/{name}.mcap", "name": name, "rig": rig,
                "started_utc": day.isoformat(), "plan": "rich", "outcome": "completed",
                "duration_s": 60.0, "rate_hz": 500.0, "verb": "identify", "exit_code": code,
                "error": error, "faults": faults,
                "jitter_s": float(f"{2e-5 * np.exp(0.3 * rng.normal()):.3g}"),
                "lost_share": 0.0, "late_share": float(f"{rng.uniform(0, 2e-4):.2g}"),
            }  # fmt: skip
            for q, (_, _, scatter, std) in QUANTITIES.items():
                value = level[q] + scatter * rng.normal() + std * rng.normal()
                value += _change(rig, q, k)
                row[q] = float(f"{value:.5g}") if code == 0 else ""
                row[f"{q}_std"] = std if code == 0 else ""
            rows.append(row)
    return rows


def _change(rig: str, quantity: str, k: int) -> float:
    total = STEP[3] if (rig, quantity) == STEP[:2] and k >= STEP[2] else 0.0
    if (rig, quantity) == DRIFT[:2]:
        total += DRIFT[2] * k / (FLIGHTS - 1)
    if (rig, quantity, k) == DEVIATING[:3]:
        total += DEVIATING[3]
    return total + (DIFFERS[2] if (rig, quantity) == DIFFERS[:2] else 0.0)


def write_results(folder: Path, rows: list[dict[str, Any]]) -> Path:
    """Write ``rows`` to ``folder``/results.csv and return its path."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "results.csv"
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(dict.fromkeys(k for r in rows for k in r)))
        writer.writeheader()
        writer.writerows(rows)
    return path


if __name__ == "__main__":
    write_results(Path(sys.argv[1]), term_rows())
