"""`make_recording`: makes a recording of arrays, with the same checks as an imported log."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from heli3dof.errors import RecordingError, UsageError
from heli3dof.recording.columns import ARRAYS
from heli3dof.recording.logs.column_table import recording_from_table
from heli3dof.recording.logs.importer import Table
from heli3dof.recording.recording import Recording, recording_of_arrays
from heli3dof.rig.log_columns import KNOWN
from heli3dof.rig.profile import Profile


def make_recording(
    t: ArrayLike,
    voltage: ArrayLike,
    angle: ArrayLike,
    profile: Profile,
    *,
    reference: ArrayLike | None = None,
    voltage_cmd: ArrayLike | None = None,
    voltage_extra: ArrayLike | None = None,
    channels: Mapping[str, np.ndarray] | None = None,
    meta: Mapping[str, Any] | None = None,
) -> Recording:
    """Return a `Recording` made of arrays, checked like an imported log (`recording_from_table`).

    ``t`` (N,) in s; voltages (N, 2) in V, front and back; ``angle``, ``reference`` (N, 3) in rad,
    roll, pitch and yaw; ``channels``: further signals, name → (N,). ``voltage_cmd``: before the
    limiter; ``voltage_extra``: added by the experiment. A column of NaN was not logged. A row
    with a NaN or a masked element is a lost sample. Warnings are in ``Recording.meta["warnings"]``.
    The class `Recording` itself checks shapes only.

    Raises UsageError for an array of a wrong shape, RecordingError for values that no rig has.
    """
    made = recording_of_arrays(
        t, voltage, angle, profile, reference=reference, voltage_cmd=voltage_cmd,
        voltage_extra=voltage_extra, channels=channels, meta=meta,
    )  # fmt: skip
    columns = {"t_s": made.t}
    for array, names in ARRAYS.items():
        for name, values in zip(names, getattr(made, array).T, strict=True):
            if array == "voltage" or not np.isnan(values).all():
                columns[name] = values
    twice = sorted(KNOWN & made.channels.keys())
    if twice:
        raise UsageError(
            f"channels has the name of a column, {twice[0]}.",
            cause="an angle or a voltage was given as a channel.",
            fix="pass it as voltage, angle, reference, voltage_cmd or voltage_extra",
        )
    table = Table(made.name, {**columns, **made.channels}, lambda k: f"sample {k}")
    try:
        return recording_from_table(table, profile, made.meta)
    except RecordingError as error:
        raise RecordingError(
            error.what,
            cause=error.cause,
            fix="correct the arrays: t in s, voltages in V, angles in rad "
            "(degrees · π/180; counts · 2π / counts per revolution)",
        ) from None
