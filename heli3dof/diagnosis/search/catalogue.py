"""List the terms that a diagnosis may add to a model, and the values at which to test them.

A *term* is an effect on one of its axes, or an effect without axes. A *probe* is a term with trial
values of its parameters, at which the score test (`search.score_test`) evaluates it. One small
value is enough for an effect that is proportional to its parameter (friction, stiffness, torque).
An effect whose shape depends on its parameters (lag, limit, dead zone) has several probes.

Two effects have no probes. A periodic torque is tested at every frequency, a change of mass at
every instant. Such a test is a *scan* (`bias_correction.scans`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from heli3dof.axes import AXES
from heli3dof.identification.bias_correction.scans import Frequencies, Instants, Scan
from heli3dof.model.effects import Term, effects
from heli3dof.model.effects.base import SMALL, Effect


@dataclass(frozen=True)
class Probe:
    """An effect with trial values of its parameters, at which the score test evaluates it."""

    term: Term
    values: tuple[float, ...]
    time_shifts: tuple[float, ...] = ()
    """s to add to the time of each recording. With these shifts, a periodic torque has the same
    phase in all recordings. () for no shift."""

    @property
    def name(self) -> str:
        return self.term.name

    @property
    def size(self) -> float | None:
        """Return the first parameter minus its null value (no effect); None for a voltage limit.

        A voltage limit has no size, because its effect does not grow with its parameter.
        """
        effect = self.term.effect
        return None if effect.probe_quantiles else self.values[0] - effect.parameters[0].null


def candidates(
    present: Sequence[str] = (), axes: Sequence[str] = AXES, refuted: Sequence[str] = ()
) -> list[Term]:
    """Return the terms on the measured ``axes`` that a diagnosis may add to a fit.

    ``present``: names of the terms that the fit already contains. ``refuted``: names of terms that
    an earlier search dropped. Both are left out. An effect may require another effect. It is a
    candidate only if the fit contains that effect.
    """
    out = []
    for effect in effects().values():
        if not (effect.candidate and effect.screened and effect.parameters):
            continue
        if any(n and n not in present for n in (effect.within, effect.requires)):
            continue
        out += on_each_axis(effect, axes, (*present, *refuted))
    return out


def terms_without_score(omitted: Sequence[str], axes: Sequence[str]) -> list[Term]:
    """Return the terms on ``axes`` that no score test detects, such as backlash.

    ``omitted``: names of terms to leave out.
    """
    effects_with_grid = [e for e in effects().values() if e.starts and e.hooks]
    return [t for e in effects_with_grid for t in on_each_axis(e, axes, omitted)]


def on_each_axis(effect: Effect, axes: Sequence[str], omitted: Sequence[str]) -> list[Term]:
    """Return the effect's terms: one for each of the ``axes`` on which the effect can act.

    An effect without axes has a single term. ``omitted``: names of terms to leave out.
    """
    where = [a for a in AXES if a in effect.axes and a in axes] if effect.axes else [None]
    return [t for t in (Term(effect, a) for a in where) if t.name not in omitted]


def probes(term: Term, V: np.ndarray) -> list[Probe]:
    """Return a term's probes: the parameter values at which the score test evaluates it.

    A voltage limit is evaluated at quantiles of |V|; ``V`` (N, 2): recorded voltages. The list is
    empty for a torque that is tested at every frequency or start time (`scans`).
    """
    effect, null = term.effect, tuple(p.null for p in term.effect.parameters)
    if effect.scan:
        return []
    if effect.probe_quantiles:
        limits = np.nanquantile(np.abs(V), effect.probe_quantiles)
        return [Probe(term, (float(v),)) for v in np.unique(limits)]
    values = effect.probes or ((null[0] + SMALL * effect.parameters[0].typical,),)
    return [Probe(term, (*v, *null[len(v) :])) for v in values]


def scans(terms: Sequence[Term]) -> list[Scan]:
    """Return a `Scan` for each of the ``terms`` that is tested at every frequency or start time.

    These terms are a periodic torque and a change of mass. The other terms have no scan.
    """
    kinds: dict[str, type[Scan]] = {"frequency": Frequencies, "instant": Instants}
    return [kinds[t.effect.scan](t) for t in terms if t.effect.scan]
