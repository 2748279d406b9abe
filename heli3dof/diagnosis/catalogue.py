"""The candidates: every effect on every axis that the base does not hold already, with its probes.

A probe is a set of values of an effect's parameters at which its trace in the innovations is
looked for. An effect that is a straight multiple of something (friction, a stiffness, a torque)
needs one, a small one. One that changes its shape with its size or has a second parameter (a lag,
a limit, a dead zone, a frequency, an instant) needs several.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.scans import Frequencies, Instants, Scan
from heli3dof.model.effects import Term, effects

IN_BASE = ("mass.imbalance", "inertia", "motor.thrust_gain")
"""The base simulation's own parameters, under other names."""
NOT_RANKED = ("encoder.scale", "inertia.product")
"""The scores of a scale are far from zero where nothing is hidden, by more than nulls can be relied
on for; most of a wrong one is another inertia anyway, which the base finds. A product of inertia
takes turn after turn in yaw to show; only fits to free flights ask for it."""
SMALL = 0.1
"""Of the typical size: a probe small enough to be a tangent."""
CLIPPED = (0.999, 0.995, 0.98, 0.95, 0.88)
"""Where a lower limit than the amplifier's is looked for: quantiles of the voltages put out."""
SCANNED = ("disturbance.periodic", "mass.change")
"""Looked for at every frequency and instant, see `heli3dof.diagnosis.scans`."""


@dataclass(frozen=True)
class Probe:
    """A term at these values of its parameters (in their units); ``size`` is what the amplitude of
    its trace is measured in: the value of its first parameter away from absent."""

    term: Term
    values: tuple[float, ...]
    size: float
    grows: bool = True
    """Its trace grows with its first parameter from nothing; a limit's does not."""

    @property
    def name(self) -> str:
        return self.term.name


def candidates(without: Sequence[str] = (), axes: Sequence[str] = AXES) -> list[Term]:
    """Every term that may be added to a base which holds the terms named ``without``.

    ``axes`` are those that were measured.
    """
    out = []
    for effect in effects().values():
        if effect.name in IN_BASE + NOT_RANKED or not (effect.screened and effect.parameters):
            continue
        if any(n and n not in without for n in (effect.within, effect.beside)):
            continue
        where: list[str | None] = [a for a in AXES if a in effect.axes and a in axes]
        if not effect.axes:
            where = [None]
        out += [t for t in (Term(effect, a) for a in where) if t.name not in without]
    return out


def probes(term: Term, V: np.ndarray) -> list[Probe]:
    """Where to look for a term, the plainest first; V (N, 2) the voltages put out. See the module.

    None for one that is scanned.
    """
    q = term.effect.parameters
    null = tuple(p.null for p in q)

    def at(*values: float) -> Probe:
        full = (*values, *null[len(values) :])
        return Probe(term, full, full[0] - null[0])

    name = term.effect.name
    if name == "motor.lag":
        return [at(v) for v in (0.02, 0.07, 0.2)]
    if name == "motor.delay":
        return [at(v) for v in (0.004, 0.02)]
    if name == "motor.dead_zone":
        return [at(v) for v in (0.3, 1.5)]
    if name == "motor.saturation":
        limits = np.nanquantile(np.abs(V), CLIPPED)
        return [Probe(term, (float(v),), -1.0, grows=False) for v in np.unique(limits)]
    if name == "aero.ground_effect":
        return [at(SMALL * q[0].typical, h) for h in (0.05, 0.1, 0.25)]
    if name in SCANNED:
        return []
    return [at(null[0] + SMALL * q[0].typical)]


def scans(terms: Sequence[Term]) -> list[Scan]:
    """The scans of those of the terms that are scanned."""
    out: list[Scan] = []
    for t in terms:
        if t.effect.name == "disturbance.periodic":
            out.append(Frequencies(t))
        elif t.effect.name == "mass.change":
            out.append(Instants(t))
    return out
