"""What else an inertia or a trim torque that is off may be: causes that the base imitates.

A step about one hover voltage tells the slope of the thrust over the inertia, not either: a curved
thrust is fitted by another inertia and nothing is left to be seen. With the screen's projection
(`screening.score_test`) of a unit of probe i onto the base, b_ji = (A⁻¹ T W δc_i)_j, a rig
that has α of it and not the base's parameter off has

    α = (θ_j − θ_edge)/b_ji,        and shows    Z = α √v_i / std_i

for the edge on its side, or more, up to the other edge. So term i is tied with the parameter where
it can have that size (up to `LARGE` typical ones, and the right sign) and the screen's own Z_i is
within `TOLD` of what it would show.

K_f is off where all of them are, by one factor (`estimate.thrust_scale`). That is the
slope of the thrust at hover too: beside a curved thrust a dead zone is nearly another K_f. There α
runs from the least to the most with which x_j(α) = θ_j − α b_ji puts K_f within the tolerance.

An inertia is tied too with what brings it back in a full fit and explains the flight no worse
(`selection.inertia_alternatives`).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from heli3dof.diagnosis.estimate.base_parameters import OffNominal, edge
from heli3dof.diagnosis.estimate.bias_correction import CorrectedFit
from heli3dof.diagnosis.estimate.thrust_scale import of_ratios, thrust_scale
from heli3dof.diagnosis.selection.select import LARGE, one_sided
from heli3dof.diagnosis.selection.steps import Step

TOLD = 3.0
"""Standard deviations"""
AMOUNTS = 21
"""Sizes that are tried, from none to the largest"""
PARAMETERS = ("mass.imbalance", "inertia.roll", "inertia.pitch", "inertia.yaw")
"""Findings, in the order of the base's free parameters"""


def with_confounded_causes(off: OffNominal, step: Step) -> OffNominal:
    """The finding, tied with what may be there in its place."""
    if off.term.name == "motor.thrust_gain":
        return replace(off, tied_with=confounded_with_thrust_gain(step))
    if off.term.name not in PARAMETERS:
        return off
    tied = confounded_causes(step, PARAMETERS.index(off.term.name))
    if off.term.effect.name == "inertia":
        tied = tuple(dict.fromkeys((*tied, *(f.term.name for f in step.instead_of_inertia))))
    return replace(off, tied_with=tied)


def look_beside(steps: Sequence[Step], found: CorrectedFit) -> Step:
    """The last look that was beside the same causes as ``found``; the last of all where none is."""
    names = {t.name for t in found.structure.terms}
    same = (s for s in reversed(steps) if {t.name for t in s.found.structure.terms} == names)
    return next(same, steps[-1])


def confounded_causes(step: Step, j: int) -> tuple[str, ...]:
    """Terms that may be there instead of the base's parameter j being off."""
    found, screen = step.found, step.screen
    f, value = found.free[j], float(found.values[j]) * thrust_scale(found).k
    if value / f.start <= 0:
        return ()
    x, at = float(np.log(value / f.start)), float(found.values[j])
    tolerance = found.structure.profile.tolerance
    on, across = (float(np.exp(edge(s, tolerance) - x)) for s in (x, -x))
    least, most = f.inward(at) - f.inward(at * on), f.inward(at) - f.inward(at * across)
    solved = enumerate(screen.solved[j, : len(screen.plain)])
    return possible(step, ((i, least / b, most / b) for i, b in solved if b))


def confounded_with_thrust_gain(step: Step) -> tuple[str, ...]:
    """Terms that may be there instead of K_f being off."""
    found, screen = step.found, step.screen
    base, half = found.free[:4], 0.5 * found.structure.profile.tolerance
    nominal = np.array([f.start for f in base])
    told = found.std[:4] / np.abs(nominal)
    at = np.array([f.inward(float(v)) for f, v in zip(base, found.values, strict=False)])

    def log_k(amount: float, b: np.ndarray) -> float:
        x = np.array([f.outward(float(c)) for f, c in zip(base, at - amount * b, strict=True)])
        return float(np.log(of_ratios(x / nominal, told, half).k))

    on = abs(edge(log_k(0.0, np.zeros(4)), found.structure.profile.tolerance))

    def enough(i: int) -> list[tuple[float, float]]:
        """The least and the most of either sign"""
        p, b = screen.plain[i], screen.solved[:4, i]
        largest = LARGE * p.term.effect.parameters[0].typical / abs(p.size)
        sizes = np.linspace(0.0, largest, AMOUNTS)[1:]
        each = [[s * a for a in sizes if abs(log_k(s * a, b)) < on] for s in (1.0, -1.0)]
        return [(a[0], a[-1]) for a in each if a]

    grow = [i for i, p in enumerate(screen.plain) if p.grows]
    return possible(step, ((i, *a) for i in grow for a in enough(i)))


def possible(step: Step, amounts: Iterable[tuple[int, float, float]]) -> tuple[str, ...]:
    """The terms of which that much, of probe i, may be there (from, to): of a size and sign that a
    rig can have, and seen as it would be."""
    screen, Z = step.screen, step.nulls.standardised(step.seen)

    def may_be(i: int, least: float, most: float) -> bool:
        p = screen.plain[i]
        if (
            p.term.effect.formal
            or not p.grows
            or not np.isfinite(screen.v[i])
            or (least < 0 and one_sided(p))
        ):
            return False
        largest = LARGE * p.term.effect.parameters[0].typical * (1 + 1e-9)
        if abs(least * p.size) > largest:
            return False
        most = np.clip(most, -largest / abs(p.size), largest / abs(p.size))
        shows = float(np.sqrt(screen.v[i])) / float(step.nulls.std[i])
        low, high = sorted((least * shows, most * shows))
        return bool(low - TOLD < float(Z[i]) < high + TOLD)

    return tuple(dict.fromkeys(screen.plain[i].name for i, *a in amounts if may_be(i, *a)))
