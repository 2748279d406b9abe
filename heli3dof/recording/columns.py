"""Return a recording's columns (N,), named with their units, for exports and data frames."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from heli3dof.axes import AXES, MOTORS
from heli3dof.rig.log_columns import ANGLES, VOLTAGES

if TYPE_CHECKING:
    from heli3dof.recording.recording import Recording

UNITS = frozenset({"s", "V", "A", "deg", "rad"})
"""Units that a column's name can end in"""


def export_columns(recording: Recording) -> dict[str, np.ndarray]:
    """Return a recording's columns (N,) by name, for an export; angles are in degrees.

    First come the logged columns of docs/reference/recording.md, then the channels (columns with
    other names). A channel with the name of an earlier column gets the prefix ``channel_``.
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
