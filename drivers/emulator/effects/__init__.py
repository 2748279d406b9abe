"""The effects, one family per file: physics that the URL option ``hide=`` adds to the ideal rig.

`catalogue` collects the tuple ``EFFECTS`` of every module in this folder. The docstring of a module
gives the equations of its effects. A new effect needs an `Effect`, which names its parameters with
units and bounds, and a function of one of two kinds:

- compiled, and called during the simulation, e.g. to add a torque
- called once before the rig runs, to change its `Setup`, e.g. an inertia

Another package registers its tuple of effects under the entry-point group `GROUP`.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

from heli3dof.effect_names import name_mistake
from heli3dof.plugins import modules_of, must_be, use_plugins

from .base import Effect, Hidden, Parameter

__all__ = ["Effect", "Hidden", "Parameter", "catalogue"]

GROUP = "heli3dof.emulated_effects"


@cache
def catalogue() -> dict[str, Effect]:
    """Return every effect, with its name as key, in alphabetical order.

    A plug-in that does not load or compile is left out, with a warning. So is a plug-in with a
    wrong function (`effect_check`), a wrong name, or the name of another effect.
    """
    effects: list[Effect] = []
    for module in modules_of(__name__):
        effects += getattr(module, "EFFECTS", ())
    by_name = {e.name: e for e in effects}

    from ..effect_check import check_effect  # it imports this module

    def add(plug_in: Sequence[Effect]) -> None:
        for effect in plug_in:
            must_be(Effect, effect)
            if effect.name in by_name:
                raise ValueError(f"there is an emulated effect {effect.name!r} already")
            if mistake := name_mistake(effect.name):
                raise ValueError(mistake)
            check_effect(effect)
        by_name.update({e.name: e for e in plug_in})

    use_plugins(GROUP, "emulated effect", add)
    return dict(sorted(by_name.items()))
