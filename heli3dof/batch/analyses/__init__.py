"""The verbs that ``heli3dof batch`` can run on each recording, one per module of this folder.

Each module defines the constant ``ANALYSIS``, an `Analysis`.
"""

from __future__ import annotations

from functools import cache

from heli3dof.batch.analyses.base import Analysis, Job
from heli3dof.plugins import modules_of

__all__ = ["Analysis", "Job", "analyses", "analysis"]


@cache
def analyses() -> dict[str, Analysis]:
    """Return name → `Analysis` of every verb."""
    found = [m.ANALYSIS for m in modules_of(__name__) if hasattr(m, "ANALYSIS")]
    return {a.name: a for a in found}


def analysis(name: str) -> Analysis:
    """Return the `Analysis` of the verb ``name``; raises KeyError if there is none."""
    return analyses()[name]
