"""The verbs that a batch can run on each recording: every module of this folder has one.

The module defines ``ANALYSIS``, an `Analysis`.
"""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache

from heli3dof.batch.analyses.base import Analysis, Job

__all__ = ["Analysis", "Job", "analyses", "analysis"]


@cache
def analyses() -> dict[str, Analysis]:
    """Return name → verb."""
    modules = [
        importlib.import_module(f"{__name__}.{m.name}") for m in pkgutil.iter_modules(__path__)
    ]
    found = [m.ANALYSIS for m in modules if hasattr(m, "ANALYSIS")]
    return {a.name: a for a in found}


def analysis(name: str) -> Analysis:
    """Return the verb of this name; raises KeyError."""
    return analyses()[name]
