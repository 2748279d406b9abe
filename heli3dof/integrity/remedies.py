"""Return the remedy of a wrong column: a ``--map`` option for a log, else a change of the profile.

`import` takes a log's angles and voltages as they are. Only the control loop computes angles from
encoder counts, so the profile's counts and rest angles do not change the angles of a log.
"""

from __future__ import annotations

import re

import numpy as np

from heli3dof.axes import MOTORS
from heli3dof.recording.logs.column_mapping import mapped
from heli3dof.recording.logs.importer import Table
from heli3dof.recording.logs.known_names import as_options, operand
from heli3dof.recording.recording import Recording


def is_log(recording: Recording) -> bool:
    """Return True if the recording was imported from another program's log."""
    return recording.meta.get("source") == "import"


def column_of(recording: Recording, quantity: str) -> tuple[str, str]:
    """Return the column that contains ``quantity``, and how `import` computed it from the log.

    ``quantity``: ``roll``, ``pitch``, ``yaw``, or the name of a voltage's column.

    The first value is the column's name. For an angle, the name ends in the unit in which `import`
    read the angle: ``roll_rad`` or ``roll_deg``. Without an import, it ends in ``_deg``.

    The second value is an expression of the log's columns, such as ``-x[3]``. If `import` copied a
    column of the log, the expression is the name of that column in the log. A ``--map`` option may
    use the result of another one, as in ``v_back_V=u`` and ``v_front_V=-v_back_V``. The function
    then substitutes the other option's expression: the value for ``v_front_V`` is ``-u``.
    """
    mapping = recording.meta.get("log_mapping") or {}
    names = [f"{quantity}_rad", f"{quantity}_deg", quantity]
    column = next((n for n in names if n in mapping), None)
    if column is None:
        column = quantity if quantity.endswith("_V") else f"{quantity}_deg"
        return column, column
    own = {n: str(e) for n, e in mapping.items() if not re.search(_word(n), str(e))}
    expression = str(mapping[column])
    for _ in own:  # a chain of mapped columns is at most as long as the mapping
        for name, inner in own.items():
            if name != column:
                expression = re.sub(_word(name), operand(inner).replace("\\", r"\\"), expression)
    return column, expression


def _word(name: str) -> str:
    """Return the regular expression of ``name`` as a whole word."""
    return rf"(?<!\w){re.escape(name)}(?!\w)"


def log_remedy(recording: Recording, quantity: str, form: str) -> str:
    """Return the advice to import the log again with a ``--map`` option that corrects ``quantity``.

    ``quantity``: as in `column_of`. ``form``: expression of the correct value, in which ``{}``
    stands for the logged value. For example, ``-{}`` changes the sign.
    """
    column, logged = column_of(recording, quantity)
    return f"import the log with {as_options({column: form.format(operand(logged))})}"


def angle_remedy(recording: Recording, axis: str, form: str, in_profile: str) -> str:
    """Return how to correct an angle: a new import of a log, or a change of the profile.

    ``form``, for a log: expression of the correct angle, in which ``{}`` stands for the logged
    angle. For example, ``-{}`` changes the sign. ``in_profile``, for a flight that heli3dof
    recorded: a setting of the profile, such as ``encoder.yaw = -8192``.
    """
    if is_log(recording):
        return log_remedy(recording, axis, form)
    return f"set {in_profile} in the profile, and record again"


def voltage_remedy(recording: Recording, front: str = "{f}", back: str = "{b}") -> str:
    """Return how to correct the motors' voltages; for a log, this is a new import with ``--map``.

    ``front``, ``back``: expressions of the correct voltages, in which ``{f}`` and ``{b}`` stand for
    the recorded front and back voltage. The defaults leave a voltage unchanged. The expressions are
    applied to the commanded voltages, too, if these have the same fault.
    """
    options: dict[str, str] = {}
    forms = ["v_{}_V"]
    if _has_same_fault(recording, front, back):
        forms.append("v_{}_cmd_V")
    for form in forms:
        (f_column, f), (b_column, b) = (column_of(recording, form.format(m)) for m in MOTORS)
        recorded = {"f": operand(f), "b": operand(b)}
        options |= {
            column: expression.format(**recorded)
            for column, expression in ((f_column, front), (b_column, back))
            if expression not in ("{f}", "{b}")
        }
    if is_log(recording):
        return f"import the log with {as_options(options)}"
    return "compute " + " and ".join(f"{c} as {e}" for c, e in options.items())


def _has_same_fault(recording: Recording, front: str, back: str) -> bool:
    """Return True if the commanded voltages have the same fault as the recorded motor voltages.

    This is so if the commanded voltages are nearer to the recorded motor voltages than to the
    corrected motor voltages. ``front``, ``back``: expressions that compute the corrected voltages
    from the recorded ones (`voltage_remedy`). The distance is the median over all rows of
    |Δ front| + |Δ back|. If no commanded voltages were recorded, the result is False.
    """
    rows = np.isfinite(recording.voltage_cmd).all(axis=1) & np.isfinite(recording.voltage).all(1)
    if not rows.any():
        return False
    voltage, command = recording.voltage[rows], recording.voltage_cmd[rows]
    logged = Table("", {"f": voltage[:, 0], "b": voltage[:, 1]}, str)
    right = {"v_front_V": front.format(f="f", b="b"), "v_back_V": back.format(f="f", b="b")}
    columns = mapped(logged, right, {}).columns
    corrected = np.column_stack([columns[name] for name in right])
    from_recorded, from_corrected = (
        np.median(np.abs(command - each).sum(axis=1)) for each in (voltage, corrected)
    )
    return bool(from_recorded < from_corrected)
