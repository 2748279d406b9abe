"""From a table of named columns (CSV, MAT, another program's MCAP) to a `Recording`.

The contract's columns: ``t_s``, ``v_front_V``, ``v_back_V``, and any of the angles, references,
voltages asked for and voltages added by the experiment; an angle is in ``_deg`` or ``_rad``.
Every other column is kept as a channel.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from heli3dof.axes import AXES, MOTORS
from heli3dof.errors import RecordingError, nearest
from heli3dof.recording.logs import angle_units, log_validation
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import Profile

REQUIRED = ("t_s", "v_front_V", "v_back_V")
VOLTAGES = {"voltage": "v_{}_V", "voltage_cmd": "v_{}_cmd_V", "voltage_extra": "v_{}_extra_V"}
ANGLES = {"angle": "{}", "reference": "{}_ref"}
KNOWN = frozenset(
    ["t_s"]
    + [form.format(motor) for form in VOLTAGES.values() for motor in MOTORS]
    + [
        f"{form.format(axis)}_{unit}"
        for form in ANGLES.values()
        for axis in AXES
        for unit in ("deg", "rad")
    ]
)
"""Every column name of the contract."""


@dataclass(frozen=True)
class Table:
    """Columns of equal length (N,), as they were read, and where they came from."""

    source: str
    """The file's name, for messages."""
    columns: Mapping[str, np.ndarray]
    where: Callable[[int], str]
    """Names sample k as its author would find it: ``line 12`` of a CSV file."""
    warnings: list[str] = field(default_factory=list)


def recording_from_table(
    table: Table, profile: Profile, meta: Mapping[str, Any], *, believed: bool = True
) -> Recording:
    """Check a table and make a `Recording` of it; what is odd but usable is in
    ``meta["warnings"]``.

    Raises RecordingError for what would make every later answer wrong: a missing or doubled
    column, a number that is none, time that does not increase, angles in another unit. Without
    ``believed`` whatever the values say against their names is left to who asks.
    """
    check_names(table)
    log_validation.long_enough(table.source, len(table.columns["t_s"]))
    columns = dict(table.columns)
    warnings = list(table.warnings)
    for name in sorted(KNOWN & columns.keys() - set(REQUIRED)):
        if np.isnan(columns[name]).all():
            warnings.append(f"The column {name} is empty; it was left out.")
            del columns[name]
    if not any(f"{axis}_{unit}" in columns for axis in AXES for unit in ("deg", "rad")):
        raise RecordingError(
            f"{table.source} has no angle.",
            cause="a log of voltages only, or angles under another name "
            f"(its columns: {', '.join(columns)}).",
            fix="name at least one column roll_deg, pitch_deg or yaw_deg (or _rad)",
        )
    for name in sorted(KNOWN & columns.keys()):
        log_validation.finite(table.source, name, columns[name], table.where)
    t = columns["t_s"]
    warnings += log_validation.time_increases(table.source, t, profile.dt, table.where)
    if believed:
        warnings += log_validation.voltages(
            table.source, columns["v_front_V"], columns["v_back_V"], profile.motor.v_max
        )
        warnings += angle_units.check_angles(table.source, columns, profile)
    if profile.loop_is_known and not any("_ref_" in name for name in columns.keys() & KNOWN):
        warnings.append(
            "The profile knows the loop ([controller]), but the log has no reference: "
            "the loop cannot be replayed as it was flown."
        )

    n = len(t)
    arrays: dict[str, np.ndarray] = {}
    used = {"t_s"}
    for array, form in VOLTAGES.items():
        arrays[array] = np.full((n, 2), np.nan)
        for i, motor in enumerate(MOTORS):
            name = form.format(motor)
            if name in columns:
                arrays[array][:, i] = columns[name]
                used.add(name)
        if len([m for m in MOTORS if form.format(m) in columns]) == 1:
            warnings.append(f"Only one of the two columns {form.format('*')} is there.")
    for array, form in ANGLES.items():
        arrays[array] = np.full((n, 3), np.nan)
        for i, axis in enumerate(AXES):
            for unit, factor in (("deg", np.pi / 180), ("rad", 1.0)):
                name = f"{form.format(axis)}_{unit}"
                if name in columns:
                    arrays[array][:, i] = columns[name] * factor
                    used.add(name)
    warnings += log_validation.punctual(t, arrays["angle"], profile.encoder.rad_per_count)
    channels = {name: values for name, values in columns.items() if name not in used}
    about = {**meta, "warnings": [*meta.get("warnings", []), *warnings]}
    return Recording(t=t, profile=profile, channels=channels, meta=about, **arrays)


def check_names(table: Table) -> None:
    """Raise RecordingError for a missing required column or an angle in two units."""
    names = list(table.columns)
    for required in REQUIRED:
        if required not in names:
            free = [n for n in names if n not in KNOWN]
            near = nearest(required, free)
            raise RecordingError(
                f"{table.source} has no column {required}"
                + (f"; the nearest is {near!r}." if near else "."),
                cause=f"another name in the logging program; its columns: {', '.join(names)}.",
                fix=f"rename {near!r} to {required} in the header line, if it is in "
                f"{'seconds' if required == 't_s' else 'volts'}"
                if near
                else f"log {required} too; without it nothing can be computed",
            )
    for form in ANGLES.values():
        for axis in AXES:
            both = [f"{form.format(axis)}_{unit}" for unit in ("deg", "rad")]
            if all(name in names for name in both):
                raise RecordingError(
                    f"{table.source} holds {both[0]} and {both[1]}: which one counts?",
                    cause="the logging program wrote the same angle twice.",
                    fix=f"remove one of the two columns, or rename it (raw_{both[1]})",
                )
