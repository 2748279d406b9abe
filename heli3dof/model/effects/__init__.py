"""The catalogue of physical effects: the modules of this folder and other packages' plug-ins."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import entry_points

from heli3dof.axes import ALIASES, AXES
from heli3dof.effect_names import name_mistake
from heli3dof.errors import UsageError, did_you_mean
from heli3dof.model.effects.base import Effect, Parameter, Term
from heli3dof.model.effects.empirical import empirical_effect
from heli3dof.model.effects.equation_check import equation_mistakes
from heli3dof.model.physics.compiled_effects import address
from heli3dof.model.physics.state_layout import Stage
from heli3dof.plugins import CodeError, in_a_line, modules_of, source_line, where

__all__ = ["Effect", "Parameter", "Stage", "Term", "effects", "plug_ins", "term", "terms"]

GROUP = "heli3dof.effects"


@dataclass(frozen=True)
class PlugIn:
    """The source of an effect that another package provides: its entry point, package, version."""

    entry_point: str
    """``module:attribute`` that holds the `Effect`"""
    distribution: str
    """The pip name of the package that registered it; empty if unknown"""
    version: str = ""

    def __str__(self) -> str:
        package = f" of the package {self.distribution} {self.version}" if self.distribution else ""
        return f"the plug-in {self.entry_point}{package}"

    @property
    def install(self) -> str:
        if not self.distribution:
            return f"pip install the package that provides {self.entry_point}"
        return (
            f"install {f'{self.distribution} {self.version}'.strip()} from where you got it: "
            "pip install FOLDER"
        )


@dataclass(frozen=True)
class _Catalogue:
    effects: Mapping[str, Effect]
    plug_ins: dict[str, PlugIn] = field(default_factory=dict)
    """{name of the effect: its plug-in}, for effects of other packages"""
    broken: list[str] = field(default_factory=list)
    """One message for each plug-in that did not load"""


@cache
def _all() -> _Catalogue:
    ours: dict[str, Effect] = {}
    for module in modules_of(__name__):
        single = [module.EFFECT] if hasattr(module, "EFFECT") else []
        ours |= {e.name: e for e in getattr(module, "EFFECTS", single)}
    result = _Catalogue(ours)
    for point in entry_points(group=GROUP):
        package = getattr(point, "dist", None)
        of = (package.name, package.version) if package else ("", "")
        plug_in = PlugIn(point.value, *of)
        try:
            effect = point.load()
            if not isinstance(effect, Effect):
                raise TypeError(f"it is a {type(effect).__name__}, not an Effect")
            if effect.name in ours or empirical_effect(effect.name):
                raise ValueError(f"there is an effect {effect.name!r} already")
            if mistake := name_mistake(effect.name):
                raise ValueError(mistake)
            for hook in effect.hooks.values():
                address(hook)
            if mistakes := equation_mistakes(effect):
                raise CodeError(mistakes[0], source_line(next(iter(effect.hooks.values()))))
        except (Exception, SystemExit) as error:
            result.broken.append(f"{plug_in} does not load: {in_a_line(error)}")
            logging.getLogger("heli3dof").warning(
                "Warning: %s, and its effects are not available. Correct %s, or: pip uninstall %s",
                result.broken[-1], where(error, point.value), plug_in.distribution or point.value,
            )  # fmt: skip
            continue
        ours[effect.name] = effect
        result.plug_ins[effect.name] = plug_in
    return result


def effects() -> Mapping[str, Effect]:
    """Return all effects by name. A plug-in that does not load is left out, with a warning."""
    return dict(sorted(_all().effects.items()))


def plug_ins() -> Mapping[str, PlugIn]:
    """Return {effect name: its plug-in} for the effects that other installed packages provide."""
    return _all().plug_ins


def broken() -> list[str]:
    """Return one error message for each effect plug-in that did not load."""
    return list(_all().broken)


def term(name: str) -> Term:
    """Return the `Term` (an effect on an axis) with a name such as ``friction.coulomb.yaw``.

    Raises UsageError if the axis is missing or the name is unknown; suggests the nearest name.
    """
    known = effects()
    if name in known and not known[name].axes:
        return Term(known[name])
    head, _, axis = name.rpartition(".")
    axis = ALIASES.get(axis, axis)
    if head in known and axis in known[head].axes:
        return Term(known[head], axis)
    if axis in AXES and (empirical := empirical_effect(head)):
        return Term(empirical, axis)
    if name in known:
        raise UsageError(
            f"The effect {name!r} needs an axis.",
            cause=f"it acts on {', '.join(known[name].axes)} separately.",
            fix=f"for instance {name}.{known[name].axes[0]}",
        )
    raise _unknown(name)


def _unknown(name: str) -> UsageError:
    cause = "a typing error, a plug-in that is not installed, or a model of a newer heli3dof; "
    fix = "heli3dof effect list"
    if broken():
        cause = f"it may be of a plug-in that did not load: {'; '.join(broken())}. If not: "
        fix = "correct the plug-in that the warning names, or install it again with pip"
    return UsageError(
        f"There is no effect {name!r}.",
        cause=f"{cause}{did_you_mean(name, all_names())}",
        fix=fix,
    )


def terms(names: Iterable[str]) -> tuple[Term, ...]:
    """Return a `Term` (effect on an axis) per name; raise UsageError if unknown or repeated."""
    result = tuple(term(n) for n in names)
    seen = [t.name for t in result]
    for n in seen:
        if seen.count(n) > 1:
            raise UsageError(
                f"The effect {n!r} is named twice.",
                cause="a repeated name, or a name with and without its axis.",
                fix="name it once",
            )
    return result


def all_names() -> list[str]:
    """Return all names of the catalogue with their axes, such as ``friction.coulomb.yaw``."""
    return [
        n
        for e in effects().values()
        for n in ([f"{e.name}.{a}" for a in AXES if a in e.axes] if e.axes else [e.name])
    ]
