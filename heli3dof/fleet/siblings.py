"""Find the rigs that differ from the other rigs in one quantity, by leave-one-out prediction.

R rigs have estimates θ̂ᵣ with standard errors vᵣ. The estimates of all rigs except rig r have the
mean θ̄ and the standard deviation S. The mean of the squared standard errors of these rigs is V.
Under the hypothesis that rig r does not differ from them::

    z = (θ̂ᵣ − θ̄)/√(S²·(1 + 1/(R − 1)) + max(vᵣ² − V, 0)) ~ Student t with R − 2 degrees of freedom

S² contains both the scatter between rigs and V. It is raised to V where it is
smaller. If all rigs have equally many flights, the distribution is exact for normal values with
S² ≥ V. A rig with fewer flights has a larger standard error. The
term max(vᵣ² − V, 0) allows for this excess variance.

The p-value of z is multiplied by the number of rigs and by the number of quantities (Bonferroni).
Two differing rigs would hide each other. So the search removes the most deviating rig, and repeats
the test with the remaining rigs. The last removed rig with a p-value of at most `LARGEST_P` differs
from the others. All rigs that were removed before it differ, too (Rosner, Technometrics 25, 1983).
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
    """Standard deviation of ``size`` under the hypothesis that the rig is like its siblings"""
    p_value: float
    """If all rigs are alike, the probability that any rig shows such a difference in any quantity
    is at most this value (Bonferroni)."""


def fleet_estimate(rigs: Mapping[str, Estimate]) -> Estimate | None:
    """Return the mean of the rigs' estimates, and the scatter between the rigs.

    The result is None if no rig's estimate has a standard error. ``rigs``: {rig: its estimate}.
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
    """Return by how much the estimate of the rig ``name`` differs from the mean of the other rigs.

    ``rigs``: {rig: its estimate of the quantity}. The p-value is multiplied by ``tests``, the
    number of tests in the fleet (Bonferroni).
    """
    from scipy.stats import t

    rig, others = rigs[name], [e for other, e in rigs.items() if other != name]
    values, errors = (np.array([getattr(e, key) for e in others]) for key in ("value", "std"))
    n = len(others)
    error = float(np.mean(errors**2))
    variance = max(float(values.var(ddof=1)), error) * (1 + 1 / n) + max(rig.std**2 - error, 0.0)
    size, std = rig.value - float(values.mean()), sqrt(variance)
    if std == 0:  # equal values, such as a share of lost samples that is always 0
        return Difference(name, size, 0.0, 1.0)
    return Difference(name, size, std, min(1.0, tests * 2 * float(t.sf(abs(size) / std, n - 1))))
