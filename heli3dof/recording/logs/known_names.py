"""Recognise another program's columns by their names.

Columns with heli3dof's names and a unit in brackets, such as ``roll [deg]``, are read as heli3dof's
(`with_own_names`). Other common names only give a suggestion, which is never used without the
user's decision, because signs differ between laboratories.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from heli3dof.errors import quoted
from heli3dof.recording.logs.importer import Table
from heli3dof.rig.log_columns import ANGLE_UNITS, KNOWN

IMPORT = "heli3dof import …"
"""Start of a proposed command, which `cli.inputs.complete_import_command` completes"""
TIME = {"time": "", "t": "", "tout": "", "seconds": "", "timestamp": "", "xvalue": "",
        "timems": "/1000", "tms": "/1000", "ms": "/1000", "milliseconds": "/1000"}  # fmt: skip
TIME_UNITS = {"s": "", "ms": "/1000"}
"""Unit of a column's name → what converts a clock in this unit to s"""
UNITS = {"s": "s", "sec": "s", "v": "V", "volt": "V", "volts": "V", "°": "deg", "deg": "deg",
         "degrees": "deg", "rad": "rad", "radians": "rad"}  # fmt: skip
"""Unit in brackets, in lower case → unit in heli3dof's names"""
AXIS_NAMES = {
    "roll": {"roll", "elevation", "elev", "ele", "epsilon", "eps", "phi"},
    "pitch": {"pitch", "tilt", "rho", "theta"},
    "yaw": {"yaw", "travel", "trav", "lambda", "psi", "azimuth"},
}
FRONT, BACK, SUM, DIFFERENCE = (
    {f"{before}{word}{after}" for word in words for before in ("v", "u", "") for after in ("", "v")}
    | {f"{before}{letter}" for letter in letters for before in ("v", "u")}
    for words, letters in (
        (("front", "frontmotor", "motorfront", "voltagefront", "frontvoltage"), "f"),
        (("back", "rear", "backmotor", "motorback", "voltageback", "backvoltage"), "br"),
        (("sum",), "s"),
        (("diff", "difference"), "d"),
    )
)
"""Names that logs give the motors' voltages, in lower case, without separators and unit"""
REFERENCE = re.compile(r"ref(erence)?|des(ired)?|cmd|command(ed)?|sp|set_?point")
UNIT = re.compile(
    r"[\s_(\[]*(°|\b(?:deg|degrees?|rad|radians?|v|volts?|m?s|m?sec))[)\]]*$", re.IGNORECASE
)


def rises(values: np.ndarray) -> bool:
    """Return True if values (N,) are finite and increase, as a clock does."""
    return bool(np.isfinite(values).all() and (np.diff(values) > 0).all())


def suggest(columns: Mapping[str, np.ndarray]) -> dict[str, str]:
    """Return column of heli3dof → expression that computes it from the log's ``columns``.

    The log's columns are recognised by common names, such as ``elevation`` for roll. ``columns``:
    name → values (N,). Columns of heli3dof that the log already has are left out. An angle without
    unit in its name counts as radians if it stays within ±2π, otherwise as degrees. A column in s
    or ms that rises is the time, whatever its name.
    """
    found: dict[str, str] = {}
    volts: dict[str, str] = {}
    for name, values in columns.items():
        if name in KNOWN:
            continue
        key, unit = _key(name)
        if unit in TIME_UNITS and (key in TIME or rises(values)):
            found.setdefault("t_s", f"{name}{TIME_UNITS[unit]}")
        elif key in TIME:
            found.setdefault("t_s", f"{name}{TIME[key]}")
        for motor, names in (("front", FRONT), ("back", BACK), ("sum", SUM), ("diff", DIFFERENCE)):
            if key in names:
                volts.setdefault(motor, name)
        bare = REFERENCE.sub("", key)
        axis = next((axis for axis, names in AXIS_NAMES.items() if bare in names), None)
        if axis is not None:
            if unit not in ANGLE_UNITS:
                unit = "rad" if np.nanmax(np.abs(values), initial=0) <= 2 * np.pi else "deg"
            found.setdefault(f"{axis}{'' if bare == key else '_ref'}_{unit}", name)
    if {"sum", "diff"} <= volts.keys() and not {"front", "back"} & volts.keys():
        found["v_front_V"] = f"({volts['sum']}+{volts['diff']})/2"
        found["v_back_V"] = f"({volts['sum']}-{volts['diff']})/2"
    found |= {f"v_{motor}_V": volts[motor] for motor in ("front", "back") if motor in volts}
    there = set(map(without_unit, KNOWN & columns.keys()))
    return {target: e for target, e in found.items() if without_unit(target) not in there}


def with_own_names(table: Table) -> Table:
    """Return ``table``, in which a column such as ``Roll [deg]`` has heli3dof's name ``roll_deg``.

    A column is renamed if its name is a quantity of heli3dof's with a unit in brackets
    (`own_name`). It keeps its name if the table has another column for the same quantity.
    """
    found = {name: own for name in table.columns if (own := own_name(name))}
    taken = Counter(map(without_unit, [*found.values(), *(KNOWN & table.columns.keys())]))
    names = {name: own for name, own in found.items() if taken[without_unit(own)] == 1}
    if not names:
        return table
    return replace(
        table,
        columns={names.get(name, name): values for name, values in table.columns.items()},
        origins={**table.origins, **{own: name for name, own in names.items()}},
        notes=[*table.notes, f"Recognised by name and unit: {', '.join(names)}."],
    )


def own_name(name: str) -> str | None:
    """Return heli3dof's name for a column whose ``name`` is a quantity with a unit in brackets.

    The result is None if heli3dof has no column of this quantity and unit.

    >>> own_name("Roll [deg]"), own_name("v_front (V)"), own_name("Time [s]"), own_name("t [ms]")
    ('roll_deg', 'v_front_V', 't_s', None)
    """
    match = re.fullmatch(r"(\w+)\s*[\[(]\s*(\S+?)\s*[\])]", name.strip())
    if match is None:
        return None
    stem = "t" if match[1].lower() == "time" else match[1].lower()
    own = f"{stem}_{UNITS.get(match[2].lower())}"
    return own if own in KNOWN else None


def as_options(mapping: Mapping[str, str]) -> str:
    """Return ``mapping``, column → expression, as ``--map`` options that are quoted for a shell."""
    return " ".join(f"--map {quoted(f'{name}={text}')}" for name, text in mapping.items())


def operand(expression: str) -> str:
    """Return an expression for use in a longer one: in parentheses, unless it is a single name.

    >>> operand("enc[1]"), operand("Vs-Vd")
    ('enc[1]', '(Vs-Vd)')
    """
    is_name = re.fullmatch(r"[^\W\d][\w.]*(\[\d+\])?", expression)
    return expression if is_name else f"({expression})"


def _key(name: str) -> tuple[str, str | None]:
    """Return a name in lower case without separators and unit, and the unit.

    The unit is deg, rad, s or ms; None for any other unit, or if the name has no unit.

    >>> _key("Elevation (deg)"), _key("theta_ref"), _key("Vf [V]")
    (('elevation', 'deg'), ('thetaref', None), ('vf', None))
    >>> _key("Zeit [ms]"), _key("time_s")
    (('zeit', 'ms'), ('time', 's'))
    """
    spaced = re.sub(r"[_\-.]+", " ", name).strip()
    match = UNIT.search(spaced)
    head = spaced[: match.start()] if match and match.start() else spaced
    unit = match.group(1).lower() if match and match.start() else ""
    key = re.sub(r"[\W_]+", "", head).lower()
    units = ("deg", "rad", "ms", "s")
    return key, "deg" if unit == "°" else next((u for u in units if unit.startswith(u)), None)


def without_unit(name: str) -> str:
    """Return a column's name without the unit of an angle: ``roll`` for ``roll_deg``.

    A name that does not end in the unit of an angle is returned unchanged.
    """
    head, _, unit = name.rpartition("_")
    return head if unit in ANGLE_UNITS else name
