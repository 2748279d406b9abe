"""Physical effects, one file each, found by being here or by the entry points' group."""

from __future__ import annotations

import importlib
import logging
import pkgutil
from collections.abc import Iterable, Mapping
from functools import cache
from importlib.metadata import entry_points

from heli3dof.axes import ALIASES, AXES
from heli3dof.errors import UsageError, did_you_mean
from heli3dof.model.effects.base import Effect, Parameter, Term
from heli3dof.model.slots import Stage

__all__ = ["Effect", "Parameter", "Stage", "Term", "effects", "term", "terms"]

GROUP = "heli3dof.effects"


@cache
def effects() -> Mapping[str, Effect]:
    """Name → effect. A plug-in that cannot be loaded is warned of and left out."""
    found: dict[str, Effect] = {}
    for module in pkgutil.iter_modules(__path__):
        effect = getattr(importlib.import_module(f"{__name__}.{module.name}"), "EFFECT", None)
        if isinstance(effect, Effect):
            found[effect.name] = effect
    for point in entry_points(group=GROUP):
        try:
            effect = point.load()
            if not isinstance(effect, Effect):
                raise TypeError(f"it is a {type(effect).__name__}, not an Effect")
            if effect.name in found:
                raise ValueError(f"there is an effect {effect.name!r} already")
            found[effect.name] = effect
        except Exception as error:
            logging.getLogger("heli3dof").warning("effect %s left out: %s", point.value, error)
    return dict(sorted(found.items()))


def term(name: str) -> Term:
    """``friction.coulomb.yaw`` → that effect on that axis. Raises UsageError naming the nearest."""
    known = effects()
    if name in known and not known[name].axes:
        return Term(known[name])
    head, _, axis = name.rpartition(".")
    axis = ALIASES.get(axis, axis)
    if head in known and axis in known[head].axes:
        return Term(known[head], axis)
    if name in known:
        raise UsageError(
            f"The effect {name!r} needs an axis.",
            cause=f"it acts on {', '.join(known[name].axes)} separately.",
            fix=f"for instance {name}.{known[name].axes[0]}",
        )
    raise UsageError(
        f"There is no effect {name!r}.",
        cause=f"a typing error, or a model of a newer heli3dof; {did_you_mean(name, all_names())}",
        fix="python -c 'from heli3dof.model.effects import all_names; print(all_names())'",
    )


def terms(names: Iterable[str]) -> tuple[Term, ...]:
    """Several at once; one name twice is an error."""
    names = list(names)
    found = [term(n) for n in names]
    seen = [t.name for t in found]
    for n in seen:
        if seen.count(n) > 1:
            raise UsageError(f"The effect {n!r} is named twice.", fix="name it once")
    return tuple(found)


def all_names() -> list[str]:
    """Every name that `term` takes."""
    return [
        n
        for e in effects().values()
        for n in ([f"{e.name}.{a}" for a in AXES if a in e.axes] if e.axes else [e.name])
    ]
