"""The candidates: every effect on every axis that the base does not hold already, with its probes.

A probe is a set of values of an effect's parameters at which its trace in the innovations is
looked for. An effect that is a straight multiple of something (friction, a stiffness, a torque)
needs one, a small one. One that changes its shape with its size or has a second parameter (a lag,
a limit, a dead zone, a frequency, an instant) needs several.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.screening.scans import Frequencies, Instants, Scan
from heli3dof.model.effects import Term, effects
from heli3dof.model.effects.base import SMALL


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
        if not (effect.candidate and effect.screened and effect.parameters):
            continue
        if any(n and n not in without for n in (effect.within, effect.requires)):
            continue
        where: list[str | None] = [a for a in AXES if a in effect.axes and a in axes]
        if not effect.axes:
            where = [None]
        out += [t for t in (Term(effect, a) for a in where) if t.name not in without]
    return out


def probes(term: Term, V: np.ndarray) -> list[Probe]:
    """The probes of a term, the simplest first; V (N, 2) the voltages of the recordings.

    Empty for a term that is scanned.
    """
    effect, null = term.effect, tuple(p.null for p in term.effect.parameters)
    if effect.scan:
        return []
    if effect.probe_quantiles:
        limits = np.nanquantile(np.abs(V), effect.probe_quantiles)
        return [Probe(term, (float(v),), -1.0, grows=False) for v in np.unique(limits)]
    values = effect.probes or ((null[0] + SMALL * effect.parameters[0].typical,),)
    return [Probe(term, (*v, *null[len(v) :]), v[0] - null[0]) for v in values]


def scans(terms: Sequence[Term]) -> list[Scan]:
    """The scans of those of the terms that are scanned."""
    kinds: dict[str, Callable[[Term], Scan]] = {"frequency": Frequencies, "instant": Instants}
    return [kinds[t.effect.scan](t) for t in terms if t.effect.scan]
