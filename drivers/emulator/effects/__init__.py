"""The effects, one family a file; every module here that has ``EFFECTS`` is found by itself.

A new effect is one new file: its physics in the docstring, a compiled function of a few lines,
and an `Effect` that names its parameters with units and bounds.
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
    found: list[Effect] = []
    for info in pkgutil.iter_modules(__path__):
        module = importlib.import_module(f"{__name__}.{info.name}")
        found += getattr(module, "EFFECTS", ())
    return {e.name: e for e in sorted(found, key=lambda e: e.name)}
