"""Base parameters that are off: the profile's own numbers as findings.

All torques and inertias are estimated in units of K_f (`heli3dof.model.rigid_body`), so one that
rises where K_f falls. Off by more than the profile's ``tolerance``, surely (two standard
deviations):

    all four by one factor      motor.thrust_gain     (K_f itself)
    T_g alone                   mass.imbalance
    an inertia alone            inertia
"""

from __future__ import annotations

import numpy as np

from heli3dof.axes import AXES
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.model.effects import Term, term


def off_nominal(found: Estimate) -> tuple[str, ...]:
    """Names of the findings; empty where the profile's numbers hold within its tolerance."""
    tolerance = found.structure.profile.tolerance
    ratio = np.array([v / f.start for f, v in zip(found.free[:4], found.values[:4], strict=True)])
    spread = found.std[:4] / np.abs([f.start for f in found.free[:4]])
    off = np.abs(ratio - 1) - 2 * spread > tolerance
    common = float(np.median(ratio))
    if abs(common - 1) > tolerance and (np.abs(ratio / common - 1) < tolerance).all():
        return ("motor.thrust_gain",) if off.any() else ()
    names = ("mass.imbalance", "inertia.roll", "inertia.pitch", "inertia.yaw")
    return tuple(n for n, bad in zip(names, off, strict=True) if bad)


def size_of(found: Estimate, name: str) -> tuple[Term, float, float, float]:
    """(the term, its parameter's value, standard deviation, score) of such a finding."""
    t = term(name)
    i = 0 if t.axis is None else 1 + AXES.index(t.axis)
    f, v, s = found.free[i], float(found.values[i]), float(found.std[i])
    value, std = {
        "mass.imbalance": (v - f.start, s),
        "motor.thrust_gain": (f.start / v, abs(f.start) * s / v**2),
    }.get(name, (v / f.start, s / f.start))
    return t, value, std, ((v - f.start) / s) ** 2
