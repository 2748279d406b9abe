"""Diagnose a simulation: its errors, their causes, and the errors of a model with these causes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def name_of(finding: Mapping[str, Any]) -> str:
    """Return a cause's name, such as ``friction.coulomb.yaw``, from its JSON object."""
    axis = finding.get("axis")
    return str(finding["effect"]) if axis is None else f"{finding['effect']}.{axis}"
