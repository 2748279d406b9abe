"""What ``profile update`` reads of a diagnosis."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from heli3dof.identification.profile_update import read_calibration


def finding(effect: str, axis: str | None, *tied_with: str, **parameters: float) -> dict[str, Any]:
    values = {name: {"value": value, "std": 0.1} for name, value in parameters.items()}
    return {"effect": effect, "axis": axis, "parameters": values, "tied_with": list(tied_with)}


def test_confounded_causes_are_left_out_but_base_parameters_are_written(tmp_path: Path) -> None:
    """The refit's value of a base parameter is in ``calibration``, confounded or not."""
    inertia = {"parameter": "J_roll", "nominal": 0.9, "value": 1.2, "std": 0.01, "unit": "kg·m²"}
    document = {
        "schema": "heli3dof.diagnosis/1",
        "calibration": [inertia],
        "findings": [
            finding("inertia", "roll", "motor.thrust_curve", ratio=1.33),
            finding("encoder.offset", "pitch", "aero.reaction_torque", angle_deg=1.4),
            finding("motor.delay", None, delay_s=0.01),
        ],
    }
    path = tmp_path / "diagnosis.json"
    path.write_text(json.dumps(document), encoding="utf-8")
    calibration = read_calibration(path)
    assert calibration.base["J_roll"].value == 1.2
    assert calibration.rest_deg == {}
    assert calibration.left_out == (
        "encoder.offset.pitch (confounded with aero.reaction_torque)",
        "motor.delay",
    )
