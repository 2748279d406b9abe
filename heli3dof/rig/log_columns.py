"""Contract columns: the columns of a log whose names docs/reference/contract.md fixes.

Required are ``t_s``, ``v_front_V`` and ``v_back_V``. Optional are angles, references, voltages
before the limiter, and voltages that the experiment adds. Every name ends in its unit; the ending
of an angle is ``_deg`` or ``_rad``.

The profile's table ``[log]`` (`LogColumns`) states how to compute these columns from the columns of
another program's log.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from pydantic import ConfigDict, model_validator
from pydantic_core import PydanticCustomError

from heli3dof.axes import AXES, MOTORS
from heli3dof.errors import did_you_mean
from heli3dof.toml_file import Section

REQUIRED = ("t_s", "v_front_V", "v_back_V")
VOLTAGES = {"voltage": "v_{}_V", "voltage_cmd": "v_{}_cmd_V", "voltage_extra": "v_{}_extra_V"}
ANGLES = {"angle": "{}", "reference": "{}_ref"}
"""`VOLTAGES`, `ANGLES`: array of a `Recording` → pattern of its columns' names. The name of an
angle continues with ``_`` and a unit of `ANGLE_UNITS`."""
ANGLE_UNITS = {"deg": np.pi / 180, "rad": 1.0}
"""Ending of an angle's name → rad per unit"""
ORDERED = (
    "t_s",
    *(form.format(motor) for form in VOLTAGES.values() for motor in MOTORS),
    *(f"{form.format(axis)}_{u}" for form in ANGLES.values() for axis in AXES for u in ANGLE_UNITS),
)
VOLTAGE_COLUMNS = frozenset(f.format(motor) for f in VOLTAGES.values() for motor in MOTORS)
KNOWN = frozenset(ORDERED)
"""All names of columns that the contract fixes; an angle has one for degrees and one for radians"""


class LogColumns(Section):
    """The profile's table ``[log]``, which describes how to read another program's log.

    A key is the name of a column of a recording, one of `KNOWN`. Its value is the expression that
    computes this column from the other log's columns, such as ``v_front_V = "(Vs-Vd)/2"``.
    """

    model_config = ConfigDict(extra="allow", frozen=True)
    __pydantic_extra__: dict[str, str]

    @model_validator(mode="after")
    def _known_columns(self) -> LogColumns:
        for name in self.__pydantic_extra__:
            if name not in KNOWN:
                raise PydanticCustomError(
                    "conflict",
                    "unknown key {key}: it is not a column of a recording",
                    {
                        "key": f"log.{name!s}",
                        "slip": f"a typing error; {did_you_mean(name, KNOWN)}",
                    },
                )
        return self

    @property
    def expressions(self) -> Mapping[str, str]:
        """Return {column of a recording: expression that computes it}, in the profile's order."""
        return dict(self.__pydantic_extra__)
