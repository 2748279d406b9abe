"""Contract columns: the columns of a log whose names docs/reference/contract.md fixes.

Required are ``t_s``, ``v_front_V`` and ``v_back_V``. Optional are angles, references, voltages
before the limiter, and voltages that the experiment adds. Every name ends in its unit, that of an
angle in ``_deg`` or ``_rad``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from heli3dof.axes import AXES, MOTORS

if TYPE_CHECKING:
    from heli3dof.recording.recording import Recording

REQUIRED = ("t_s", "v_front_V", "v_back_V")
VOLTAGES = {"voltage": "v_{}_V", "voltage_cmd": "v_{}_cmd_V", "voltage_extra": "v_{}_extra_V"}
ANGLES = {"angle": "{}", "reference": "{}_ref"}
"""Array of a `Recording` → pattern of its columns' names; an angle's unit is to be added"""
ANGLE_UNITS = {"deg": np.pi / 180, "rad": 1.0}
"""Ending of an angle's name → rad per unit"""
UNITS = frozenset({"s", "V", "A", "deg", "rad"})
"""Units that a column's name can end in"""
KNOWN = frozenset(
    ["t_s"]
    + [form.format(motor) for form in VOLTAGES.values() for motor in MOTORS]
    + [
        f"{form.format(axis)}_{unit}"
        for form in ANGLES.values()
        for axis in AXES
        for unit in ANGLE_UNITS
    ]
)
"""Every column name of the contract, angles in both units"""


def contract_columns(recording: Recording) -> dict[str, np.ndarray]:
    """Return a recording's columns (N,) by name, for an export; angles are in degrees.

    First come the logged columns of docs/reference/contract.md, then the channels. A channel with
    the name of an earlier column gets the prefix ``channel_``.
    """
    columns: dict[str, np.ndarray] = {"t_s": recording.t}
    for array, form in VOLTAGES.items():
        for i, motor in enumerate(MOTORS):
            columns[form.format(motor)] = getattr(recording, array)[:, i]
    for array, form in ANGLES.items():
        for i, axis in enumerate(AXES):
            columns[f"{form.format(axis)}_deg"] = np.rad2deg(getattr(recording, array)[:, i])
    columns = {name: v for name, v in columns.items() if not np.isnan(v).all()}
    for name, values in recording.channels.items():
        columns[name if name not in columns else f"channel_{name}"] = values
    return columns


def unit_of(name: str) -> str:
    """Return the unit that a column's name ends in; an empty text if there is none.

    >>> unit_of("roll_ref_deg"), unit_of("v_front_V"), unit_of("flags")
    ('deg', 'V', '')
    """
    ending = name.rpartition("_")[2]
    return ending if ending in UNITS else ""
