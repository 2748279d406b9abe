"""The name of a cause in a diagnosis' JSON document: the effect, with its axis if it has one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def name_of(finding: Mapping[str, Any]) -> str:
    """Return a cause's name, as ``friction.coulomb.yaw``, from an object of ``findings``."""
    axis = finding.get("axis")
    return str(finding["effect"]) if axis is None else f"{finding['effect']}.{axis}"
