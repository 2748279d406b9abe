"""``python -m tests.hidden.survey``: flies every plan with every effect at every size.

Prints which flights trip and how close to the envelope the others come; the sizes follow from it.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor

import numpy as np

from tests.hidden.cases import CLASSES, SPREAD, plan_named
from tests.hidden.sizes import EFFECTS, ONE_WAY, OUTSIDE, RATIO, SIZES, Effect

PLANS = ("rich", "steps", "run-step")
SEEDS = (1001, 1002)
TAKEN_OFF_S = 5.0


def texts(effect: Effect) -> Iterator[tuple[str, str]]:
    """(size, hide=…) at every size, in both directions if the effect has two."""
    for size, value in zip(SIZES, effect.sizes, strict=True):
        other = 1 / value if effect.way == RATIO else -value
        for v in (value,) if effect.way == ONE_WAY else (value, other):
            more = "@20" if effect.name == "mass.change" else ""
            more = "@0.5" if effect.name.startswith("disturbance.periodic") else more
            yield size, f"{effect.name}:{v:.6g}{more}"


def flown(plan: str, hide: str, seed: int) -> tuple[str, str, tuple[float, ...]]:
    """Ending, its detail, and the largest angles (°) and voltage (V) of a flight."""
    from heli3dof.experiment.fly import fly_plan

    device = f"mock:?speed=max&spread={SPREAD:g}&seed={seed}&hide={hide}"
    flight = fly_plan(plan_named(plan), device=device, seed=seed)
    r = flight.recording
    aloft = (r.t > TAKEN_OFF_S) & (r.t < plan_named(plan).duration_s)
    angle = np.degrees(np.abs(r.angle[aloft]).max(axis=0, initial=0.0))
    return (
        flight.outcome.ending, flight.outcome.detail,
        (*map(float, angle), float(np.abs(r.voltage).max())),
    )  # fmt: skip


def main(processes: int) -> None:
    assert {c.plan for c in CLASSES.values()} == set(PLANS)
    effects = [*EFFECTS.values(), *OUTSIDE.values()]
    jobs = [
        (plan, size, hide, seed)
        for effect, plan, seed in itertools.product(effects, PLANS, SEEDS)
        for size, hide in texts(effect)
    ]
    tripped = 0
    with ProcessPoolExecutor(processes) as pool:
        results = pool.map(flown, *zip(*[(p, h, s) for p, _, h, s in jobs], strict=True))
        for (plan, size, hide, seed), (ending, detail, peak) in zip(jobs, results, strict=True):
            tripped += ending != "completed"
            trip = "" if ending == "completed" else f"  {ending.upper()}: {detail}"
            print(
                f"{plan:9} {size:7} {seed} {hide:50} {peak[0]:5.1f} {peak[1]:5.1f} {peak[2]:6.1f}° "
                f"{peak[3]:5.1f} V{trip}",
                flush=True,
            )
    print(f"{len(jobs)} flights, {tripped} did not reach their end")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 2)
