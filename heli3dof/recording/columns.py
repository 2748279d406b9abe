"""Names and units of a recording's columns (N,), and the columns for exports and data frames."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from heli3dof.axes import AXES, MOTORS
from heli3dof.rig.log_columns import ANGLES, VOLTAGES

if TYPE_CHECKING:
    from heli3dof.recording.recording import Recording

ARRAYS: dict[str, tuple[str, ...]] = {
    **{array: tuple(form.format(motor) for motor in MOTORS) for array, form in VOLTAGES.items()},
    **{array: tuple(f"{form.format(axis)}_rad" for axis in AXES) for array, form in ANGLES.items()},
}
"""Array of a `Recording` → names of its columns, in V or rad"""
UNITS = frozenset({"s", "V", "A", "deg", "rad"})
"""Units that a column's name can end in"""


def export_columns(recording: Recording) -> dict[str, np.ndarray]:
    """Return a recording's columns (N,) by name, for an export; angles are in degrees.

    First come the logged columns of docs/reference/recording.md, then the channels (columns with
    other names). A channel with the name of an earlier column gets the prefix ``channel_``.
    """
    columns: dict[str, np.ndarray] = {"t_s": recording.t}
    for array, names in ARRAYS.items():
        for name, values in zip(names, getattr(recording, array).T, strict=True):
            if array in ANGLES:
                columns[name.replace("_rad", "_deg")] = np.rad2deg(values)
            else:
                columns[name] = values
    columns = {name: v for name, v in columns.items() if name == "t_s" or not np.isnan(v).all()}
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
