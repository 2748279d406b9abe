"""Find the rigs that differ from the other rigs in one quantity, by leave-one-out prediction.

R rigs have estimates θ̂ᵣ with standard errors vᵣ. Without rig r, the estimates have the mean θ̄ and
the standard deviation S, and the squared standard errors the mean v². If r is like the others::

    z = (θ̂ᵣ − θ̄)/√(S²·(1 + 1/(R − 1)) + max(vᵣ² − v², 0)) ~ Student t with R − 2 degrees of freedom

S² contains the scatter between rigs and the mean squared error v². If each rig has equally many
flights, the distribution is exact for normal values. For a rig with fewer flights,
max(vᵣ² − v², 0) adds its larger error.

The p-value of z is multiplied by the number of rigs and by that of quantities (Bonferroni). Two
differing rigs would hide each other. So the search removes the most deviating rig, and tests the
next one against the rest. The last removed rig with a p-value of at most `LARGEST_P` differs, and
so do all that were removed before it (Rosner, Technometrics 25, 1983).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import hypot, isfinite, sqrt

import numpy as np

from heli3dof.fleet.random_effects import Estimate, random_effects

LARGEST_P = 0.05
"""Chance that any rig is reported in any quantity although all rigs are alike (a convention)"""
MOST_DIFFERING = 0.25
"""Largest share of differing rigs: with more, the others would be no reference. Chosen."""
LEAST_RIGS = 3
"""Fewest rigs for a test: a rig and two siblings, the least number that has a scatter"""


@dataclass(frozen=True)
class Difference:
    """A rig that differs from the other rigs in one quantity."""

    rig: str
    size: float
    """The rig's value minus the siblings' mean, in the quantity's unit"""
    std: float
    """Predicted standard deviation of ``size`` for a rig like its siblings"""
    p_value: float
    """Chance of such a difference anywhere in the fleet if all rigs are alike"""


def fleet_estimate(rigs: Mapping[str, Estimate]) -> Estimate | None:
    """Return the mean of the rigs' estimates, and the scatter between the rigs.

    It is None if no rig has a standard error. ``rigs``: {rig: its estimate}.
    """
    known = [e for e in rigs.values() if isfinite(e.std)]
    if not known:
        return None
    return random_effects(np.array([e.value for e in known]), np.array([e.std for e in known]))


def differing_rigs(rigs: Mapping[str, Estimate], quantities: int) -> tuple[Difference, ...]:
    """Return the rigs that differ from the others in one quantity, most deviating first.

    ``rigs``: rig → its estimate; ``quantities``: number of quantities tested in the fleet.
    """
    known = {name: e for name, e in rigs.items() if isfinite(e.std)}
    between = [e.scatter for e in known.values() if e.n > 1]
    typical = float(np.median(between)) if between else 0.0
    # The scatter between flights is added to an estimate from a single flight.
    left = {
        name: e if e.n > 1 else replace(e, std=hypot(e.std, typical)) for name, e in known.items()
    }
    removed: list[Difference] = []
    while len(left) >= LEAST_RIGS and len(removed) < max(1, MOST_DIFFERING * len(known)):
        found = [_difference(name, left, len(left) * quantities) for name in left]
        found = [d for d in found if d.std > 0]
        if not found:
            break
        removed.append(min(found, key=lambda d: (d.p_value, -abs(d.size) / d.std)))
        del left[removed[-1].rig]
    last = max((i for i, d in enumerate(removed) if d.p_value <= LARGEST_P), default=-1)
    return tuple(removed[: last + 1])


def _difference(name: str, rigs: Mapping[str, Estimate], tests: int) -> Difference:
    """Return a rig's difference from the others; its p-value is multiplied by ``tests``."""
    from scipy.stats import t

    rig, others = rigs[name], [e for other, e in rigs.items() if other != name]
    values, errors = (np.array([getattr(e, key) for e in others]) for key in ("value", "std"))
    n = len(others)
    variance = float(values.var(ddof=1)) * (1 + 1 / n)
    variance += max(rig.std**2 - float(np.mean(errors**2)), 0.0)
    size, std = rig.value - float(values.mean()), sqrt(variance)
    if std == 0:  # equal values, such as a share of lost samples that is always 0
        return Difference(name, size, 0.0, 1.0)
    return Difference(name, size, std, min(1.0, tests * 2 * float(t.sf(abs(size) / std, n - 1))))
