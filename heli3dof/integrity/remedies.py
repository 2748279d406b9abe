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
    """Return the column of an imported log for ``quantity``, and the expression that computed it.

    The expression of a column that was not mapped is its name. ``quantity``: ``roll``, ``pitch`` or
    ``yaw`` (in the unit of the log's mapping, or else degrees), ``v_front_V`` or ``v_back_V``.
    """
    mapping = recording.meta.get("log_mapping") or {}
    names = [f"{quantity}_rad", f"{quantity}_deg", quantity]
    column = next((n for n in names if n in mapping), None)
    if column is None:
        column = quantity if quantity.endswith("_V") else f"{quantity}_deg"
        return column, column
    return column, str(mapping[column])


def log_remedy(recording: Recording, quantity: str, form: str) -> str:
    """Return the ``--map`` option of an imported log that corrects ``quantity`` (`column_of`).

    ``form``: the right value, with ``{}`` for the logged one, such as ``-{}``.
    """
    column, logged = column_of(recording, quantity)
    return f"import the log with {as_options({column: form.format(operand(logged))})}"


def angle_remedy(recording: Recording, axis: str, form: str, in_profile: str) -> str:
    """Return how to correct an angle: ``form`` for a log, ``in_profile`` for a recorded flight.

    ``form``: the right value, with ``{}`` for the logged one, such as ``-{}``. ``in_profile``: a
    setting of the profile, such as ``encoder.yaw = -8192``.
    """
    if is_log(recording):
        return log_remedy(recording, axis, form)
    return f"set {in_profile} in the profile, and record again"


def voltage_remedy(recording: Recording, front: str = "{f}", back: str = "{b}") -> str:
    """Return how to compute the motors' voltages: ``--map`` options for a log.

    ``front``, ``back``: expressions with ``{f}`` and ``{b}`` for the recorded voltages; the default
    leaves a voltage as it is.
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
