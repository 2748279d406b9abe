"""Find out why a simulation of the rig predicts recordings badly, and extend its model.

A diagnosis computes the prediction errors of the simulation, identifies the physical effects that
cause them, and computes the errors that remain when the model contains these effects.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def name_of(finding: Mapping[str, Any]) -> str:
    """Return a cause's name, such as ``friction.coulomb.yaw``, from its JSON object."""
    axis = finding.get("axis")
    return str(finding["effect"]) if axis is None else f"{finding['effect']}.{axis}"
