"""How soon an encoder that freezes in a calm hover is found, and how often a watch is wrong."""

from __future__ import annotations

import os
import statistics

from heli3dof.axes import AXES
from heli3dof.rig.profile import default_profile
from tests.bench import Figure, at_most
from tests.experiment.watches.hovering import hover

TITLE = "Watches in a calm hover"
INTRO = (
    "The emulated rig holds level at 500 Hz, every watch on; nothing is asked of it. An encoder "
    "freezes after a minute: seconds until the flight is ended. Then nothing freezes, for hours: "
    "flights that a watch ended. Random torques (`noise`) of a third, once and three times the "
    "usual in turn; seeds 1, 2, …"
)
FROZEN = int(os.environ.get("WATCHES_FROZEN", "12"))
"""flights for each axis"""
HOURS = float(os.environ.get("WATCHES_HOURS", "10"))
FREEZES_S, LONGEST_S = 60.0, 180.0
FLIGHT_S = 1200.0


def measure() -> list[Figure]:
    rows = []
    for axis in AXES:
        took = [found_s(axis, seed) for seed in range(1, FROZEN + 1)]
        found = [s for s in took if s is not None]
        median = statistics.median(found) if found else float("nan")
        rows.append(_seen(f"{axis} freezes: found after, median", median, "s"))
        rows.append(_seen(f"{axis} freezes: longest", max(found, default=float("nan")), "s"))
        unseen = len(took) - len(found)
        seconds = LONGEST_S - FREEZES_S
        how = f"of {len(took)}; the axis did not turn by 2 counts often enough to be known"
        rows.append(_seen(f"{axis} freezes: not found in {seconds:g} s", unseen, "", how=how))
    flights = max(1, round(HOURS * 3600 / FLIGHT_S))
    wrong = sum(hover(FLIGHT_S, seed).ending != "completed" for seed in range(1, flights + 1))
    hours = flights * FLIGHT_S / 3600
    rows.append(at_most(f"flights ended wrongly in {hours:g} h", wrong, 0, "", how="none froze"))
    return rows


def found_s(axis: str, seed: int) -> float | None:
    """Seconds from the freeze to the end; None: flown to its end."""
    outcome = hover(LONGEST_S, seed, f"&fault=frozen.{axis}@{FREEZES_S:g}")
    if outcome.ending == "completed":
        return None
    return outcome.periods * default_profile().dt - FREEZES_S


def _seen(what: str, value: float, unit: str, how: str = "") -> Figure:
    return Figure(what, f"{value:.3g} {unit}".strip(), "", None, how)
