"""The effects, one family per file: physics that the URL option ``hide=`` adds to the ideal rig.

Every module in this folder is loaded for its tuple ``EFFECTS``. A new effect needs its physics in
the module's docstring, a short compiled function, and an `Effect` that names its parameters with
units and bounds.
"""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache

from .base import Effect, Hidden, Parameter

__all__ = ["Effect", "Hidden", "Parameter", "catalogue"]


@cache
def catalogue() -> dict[str, Effect]:
    """Return every effect, with its name as key, in alphabetical order."""
    effects: list[Effect] = []
    for info in pkgutil.iter_modules(__path__):
        module = importlib.import_module(f"{__name__}.{info.name}")
        effects += getattr(module, "EFFECTS", ())
    return {e.name: e for e in sorted(effects, key=lambda e: e.name)}
