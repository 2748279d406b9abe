"""The effects that the emulated rig can hide, one family per file.

A new effect is one new file with ``EFFECTS``: its physics in the docstring, a compiled function of
a few lines, and an `Effect` that names its parameters with units and bounds. Every module in this
folder is loaded.
"""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache

from .base import Effect, Hidden, Parameter

__all__ = ["Effect", "Hidden", "Parameter", "catalogue"]


@cache
def catalogue() -> dict[str, Effect]:
    """Every effect by its name, in alphabetical order."""
    effects: list[Effect] = []
    for info in pkgutil.iter_modules(__path__):
        module = importlib.import_module(f"{__name__}.{info.name}")
        effects += getattr(module, "EFFECTS", ())
    return {e.name: e for e in sorted(effects, key=lambda e: e.name)}
