"""`MemoryRecorder`: records a flight in memory, for the Python API, tests and simulations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from heli3dof.arrays import FloatArray
from heli3dof.recording.recording import Recording, make_recording, output_voltage
from heli3dof.recording.row import Row
from heli3dof.rig.profile import Profile


class MemoryRecorder:
    """Recorder that keeps a flight's rows, one for each control period, in a list in memory."""

    def __init__(self) -> None:
        self.rows: list[Row] = []

    def append(self, row: Row) -> None:
        self.rows.append(row)

    def recording(self, profile: Profile, meta: Mapping[str, Any]) -> Recording:
        """Return the rows as a recording, like one read from a file of the same flight."""
        return rows_to_recording(self.rows, profile, meta)


def rows_to_recording(rows: Sequence[Row], profile: Profile, meta: Mapping[str, Any]) -> Recording:
    """Return a recording made of rows, one for each control period.

    ``Recording.voltage`` is the output voltage that the device reports. If the device never reports
    it, the voltage sent is used (`output_voltage`). ``meta`` becomes ``Recording.meta``.
    """
    n = len(rows)

    def column(values: list[Any], width: int) -> FloatArray:
        return np.array(values, dtype=float).reshape(n, width)

    def single(values: list[float]) -> FloatArray:
        return np.array(values, dtype=float)

    def whole(values: list[int]) -> FloatArray:
        return np.array(values, dtype=np.int64)

    counts = np.array([r.sample.counts for r in rows], dtype=np.int64).reshape(n, 3)
    limited = column([r.limited for r in rows], 3)
    sent = column([r.voltage for r in rows], 2)
    current = column([r.sample.current for r in rows], 2)
    channels = {
        "device_time_s": single([r.sample.device_time_s for r in rows]),
        "lateness_s": single([r.lateness for r in rows]),
        "roll_count": counts[:, 0],
        "pitch_count": counts[:, 1],
        "yaw_count": counts[:, 2],
        "i_front_A": current[:, 0],
        "i_back_A": current[:, 1],
        "flags": whole([int(r.sample.flags) for r in rows]),
        "sequence": whole([r.sample.sequence for r in rows]),
        "host_time_s": single([r.sample.host_time_s for r in rows]),
        "roll_ref_limited_rad": limited[:, 0],
        "pitch_ref_limited_rad": limited[:, 1],
        "yaw_ref_limited_rad": limited[:, 2],
        "v_front_sent_V": sent[:, 0],
        "v_back_sent_V": sent[:, 1],
        "command_sequence": whole([r.command_sequence for r in rows]),
        "phase": whole([r.phase for r in rows]),
    }
    channels = {k: v for k, v in channels.items() if v.dtype.kind != "f" or not np.isnan(v).all()}
    return make_recording(
        np.array([r.t for r in rows]),
        output_voltage(column([r.applied for r in rows], 2), sent),
        column([r.angle for r in rows], 3),
        profile,
        reference=column([r.reference for r in rows], 3),
        voltage_cmd=column([r.command for r in rows], 2),
        voltage_extra=column([r.extra for r in rows], 2),
        channels=channels,
        meta=meta,
    )
