"""Check a log's table of named columns and convert it to a `Recording`.

Columns with unknown names become the recording's channels. Angles in ``_deg`` are converted to
radians.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from heli3dof.axes import AXES, MOTORS
from heli3dof.errors import RecordingError, listed, nearest
from heli3dof.recording.columns import ARRAYS
from heli3dof.recording.logs import angle_units, log_validation
from heli3dof.recording.logs.importer import Table
from heli3dof.recording.logs.known_names import IMPORT, as_options, operand, suggest
from heli3dof.recording.recording import Recording
from heli3dof.rig.log_columns import ANGLE_UNITS, ANGLES, KNOWN, REQUIRED, VOLTAGES
from heli3dof.rig.profile import Profile

LISTED = 20
"""Largest number of column names in a message"""


def recording_from_table(
    table: Table, profile: Profile, meta: Mapping[str, Any], *, check_values: bool = True
) -> Recording:
    """Check a table and return it as a `Recording`; warnings are added to ``meta["warnings"]``.

    ``check_values=False`` skips the tests whether the angles and voltages have plausible values for
    the units in the columns' names. Raises RecordingError for:

    * a missing required column, or no angle at all
    * an angle both in degrees and in radians, or in another unit than its name states
    * fewer than ten samples, or values that are not finite in over 30 % of them
    * time that does not increase or is not in seconds
    """
    check_names(table, profile.loop.rate_hz)
    log_validation.check_length(table.source, len(table.columns["t_s"]))
    columns = dict(table.columns)
    warnings = list(table.warnings)
    for name in sorted(KNOWN & columns.keys() - set(REQUIRED)):
        if np.isnan(columns[name]).all():
            warnings.append(f"The column {name} is empty and was ignored.")
            del columns[name]
    for entry in table.ignored:
        name, _, reason = entry.partition(": ")
        if name in KNOWN and name not in columns:
            warnings.append(f"The column {name} was ignored: {reason}.")
    if not any(f"{axis}_{unit}" in columns for axis in AXES for unit in ANGLE_UNITS):
        raise RecordingError(
            f"{table.source} has no angle column.",
            cause="only voltages were logged, or the angles have other names "
            f"(its columns: {listed(columns, LISTED)}).",
            fix=_mapping_remedy(table, "roll_deg=EXPRESSION (or pitch_deg, yaw_deg, _rad)"),
        )
    known = {name: columns[name] for name in sorted(KNOWN & columns.keys())}
    lost = log_validation.lost_rows(table.source, known, table.where)
    if lost.any():
        k = int(np.argmax(lost))
        name = next(name for name, values in known.items() if not np.isfinite(values[k]))
        warnings.append(
            f"{lost.sum()} of {len(lost)} rows have a value that is not finite and were left out "
            f"as lost samples; the first is {table.where(k)}, column {name}."
        )
        kept = np.flatnonzero(~lost)
        columns = {name: values[kept] for name, values in columns.items()}
        where = table.where
        table = replace(table, where=lambda k: where(int(kept[k])))
    t = columns["t_s"]
    warnings += log_validation.check_sampling_times(
        table.source, t, profile.dt, table.where, _expression(table, "t_s")
    )
    if check_values:
        warnings += log_validation.check_voltages(
            table.source, columns["v_front_V"], columns["v_back_V"], profile.motor.v_max,
            (_expression(table, "v_front_V"), _expression(table, "v_back_V")),
        )  # fmt: skip
        warnings += angle_units.check_angles(table.source, columns, profile, table.origins)
    if profile.controller_is_known and not any("_ref_" in name for name in columns.keys() & KNOWN):
        warnings.append(
            "The profile has a [controller], but the log has no reference: the closed loop cannot "
            "be replayed."
        )

    for form in VOLTAGES.values():
        if sum(form.format(motor) in columns for motor in MOTORS) == 1:
            warnings.append(f"Only one of the two columns {form.format('*')} was found.")
    in_si: dict[str, np.ndarray] = {}
    for name in KNOWN & columns.keys():
        head, _, unit = name.rpartition("_")
        own = f"{head}_rad" if unit in ANGLE_UNITS else name
        in_si[own] = columns[name] * ANGLE_UNITS.get(unit, 1.0)
    not_logged = np.full(len(t), np.nan)
    arrays: dict[str, Any] = {
        array: np.column_stack([in_si.get(name, not_logged) for name in names])
        for array, names in ARRAYS.items()
    }
    warnings += log_validation.hidden_timing_warnings(
        t, arrays["angle"], profile.encoder.rad_per_count
    )
    channels = {name: values for name, values in columns.items() if name not in KNOWN}
    about = {**meta, "warnings": [*meta.get("warnings", []), *warnings]}
    return Recording(t=t, profile=profile, channels=channels, meta=about, **arrays)


def check_names(table: Table, rate_hz: float) -> None:
    """Raise RecordingError if a required column is missing, or an angle is given in two units.

    ``rate_hz``: the sampling rate in the profile. If the log has no time column, the error message
    proposes to compute the time from this rate.
    """
    names = list(table.columns)
    missing = [required for required in REQUIRED if required not in names]
    if missing:
        expression = f"sample/{rate_hz:g}" if missing[0] == "t_s" else "EXPRESSION"
        near = nearest(missing[0], [n for n in names if n not in KNOWN])
        raise RecordingError(
            f"{table.source} has no column {', '.join(missing)}"
            + (f"; the nearest is {near!r}." if near else "."),
            cause=f"the logging program named it otherwise; its columns: {listed(names, LISTED)}.",
            fix=_mapping_remedy(table, f"{missing[0]}={expression}"),
        )
    for form in ANGLES.values():
        for axis in AXES:
            both = [f"{form.format(axis)}_{unit}" for unit in ANGLE_UNITS]
            if all(name in names for name in both):
                raise RecordingError(
                    f"{table.source} has both {both[0]} and {both[1]}.",
                    cause="the logging program wrote the same angle twice.",
                    fix=f"remove one of the two columns, or rename one (raw_{both[1]})",
                )


def _expression(table: Table, column: str) -> str:
    """Return the expression from which ``column`` was computed, for use in a longer expression.

    The expression contains names of the log's columns. Unless it is a single name, it is in
    parentheses.
    """
    return operand(table.origins.get(column, column))


def _mapping_remedy(table: Table, example: str) -> str:
    """Return the advice of an error message: a command that imports the log with ``--map`` options.

    If `known_names` recognises columns of the log, the options map these columns to heli3dof's. The
    advice then also lists the required columns that still need a ``--map`` option. If no column is
    recognised, the option is ``example``, such as ``t_s=EXPRESSION``.
    """
    found = suggest(table.columns)
    if found:
        missing = [n for n in REQUIRED if n not in found and n not in table.columns]
        more = f" and a --map for {', '.join(missing)}" if missing else ""
        return f"check units and signs in the preview of {IMPORT} {as_options(found)}{more}"
    return (
        f"{IMPORT} --map '{example}', with names of the log's columns, such as "
        "(Vs-Vd)/2 or 57.3*x[5]"
    )
