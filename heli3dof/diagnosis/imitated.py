"""What else an inertia or a trim torque that is off may be: causes that the base imitates.

A step about one hover voltage tells the slope of the thrust over the inertia, not either: a curved
thrust is fitted by another inertia and nothing is left to be seen. With the screen's projection
(`heli3dof.diagnosis.screen`) of a unit of probe i onto the base, b_ji = (A⁻¹ T W δc_i)_j, a rig
that has α of it and not the base's parameter off has

    α = (θ_j − θ_edge)/b_ji,        and shows    Z = α √v_i / std_i

So term i is tied with the parameter where it can have that size (up to `LARGE` typical ones, and
the right sign) and the screen's own Z_i is within `TOLD` of what it would show.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from heli3dof.diagnosis.calibration import Off, edge
from heli3dof.diagnosis.select import LARGE, one_way
from heli3dof.diagnosis.steps import Step
from heli3dof.diagnosis.thrust_scale import thrust_scale

TOLD = 3.0
"""Standard deviations"""
PARAMETERS = ("mass.imbalance", "inertia.roll", "inertia.pitch", "inertia.yaw")
"""Findings, in the order of the base's free parameters"""


def with_imitators(off: Off, step: Step) -> Off:
    """The finding, tied with what may be there in its place; K_f's has no place to be taken."""
    if off.term.name not in PARAMETERS:
        return off
    return replace(off, tied_with=imitators(step, PARAMETERS.index(off.term.name)))


def imitators(step: Step, j: int) -> tuple[str, ...]:
    """Terms that may be there instead of the base's parameter j being off."""
    found, screen = step.found, step.screen
    f, value = found.free[j], float(found.values[j]) * thrust_scale(found).k
    if value / f.start <= 0:
        return ()
    x = float(np.log(value / f.start))
    on = float(np.exp(edge(x, found.structure.profile.tolerance)))
    need = f.inward(float(found.values[j])) - f.inward(float(found.values[j]) * on / np.exp(x))
    Z = step.nulls.judged(step.seen)
    names: list[str] = []
    for i, p in enumerate(screen.plain):
        b = float(screen.solved[j, i])
        if not p.grows or not np.isfinite(screen.v[i]) or b == 0.0:
            continue
        alpha = need / b
        size = abs(alpha * p.size)
        possible = size <= LARGE * p.term.effect.parameters[0].typical
        shown = alpha * float(np.sqrt(screen.v[i])) / float(step.nulls.std[i])
        if possible and (alpha > 0 or not one_way(p)) and abs(float(Z[i]) - shown) < TOLD:
            names.append(p.name)
    return tuple(dict.fromkeys(names))
