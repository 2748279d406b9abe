"""Return the remedy of a wrong column: a ``--map`` option for a log, else a change of the profile.

`import` takes a log's angles and voltages as they are. Only the control loop computes angles from
encoder counts, so the profile's counts and rest angles do not change the angles of a log.
"""

from __future__ import annotations

from heli3dof.axes import MOTORS
from heli3dof.recording.logs.known_names import as_options, operand
from heli3dof.recording.recording import Recording


def is_log(recording: Recording) -> bool:
    """Return True if the recording was imported from another program's log."""
    return recording.meta.get("source") == "import"


def column_of(recording: Recording, quantity: str) -> tuple[str, str]:
    """Return the column that contains ``quantity``, and how import computed it from the log.

    The second value is an expression of the log's columns, such as ``-x[3]``. If import copied the
    column unchanged, it is the column's name. ``quantity``: ``roll``, ``pitch``, ``yaw``,
    ``v_front_V`` or ``v_back_V``. An angle's column has the unit of the log's mapping, or degrees
    without a mapping.
    """
    mapping = recording.meta.get("log_mapping") or {}
    names = [f"{quantity}_rad", f"{quantity}_deg", quantity]
    column = next((n for n in names if n in mapping), None)
    if column is None:
        column = quantity if quantity.endswith("_V") else f"{quantity}_deg"
        return column, column
    return column, str(mapping[column])


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
    the recorded front and back voltage. The defaults leave a voltage unchanged.
    """
    (f_column, f), (b_column, b) = (column_of(recording, f"v_{m}_V") for m in MOTORS)
    recorded = {"f": operand(f), "b": operand(b)}
    options = {
        column: expression.format(**recorded)
        for column, expression in ((f_column, front), (b_column, back))
        if expression not in ("{f}", "{b}")
    }
    if is_log(recording):
        return f"import the log with {as_options(options)}"
    return "compute " + " and ".join(f"{c} as {e}" for c, e in options.items())
