"""Synthetic recordings for tests, on the encoder's grid and with plausible motion."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from heli3dof.recording.mcap_files.flight_recorder import RecordingWriter
from heli3dof.recording.recording import Recording, recording_of_arrays
from heli3dof.recording.row import Row
from heli3dof.rig.interface import Flags, Sample
from heli3dof.rig.profile import Profile, default_profile, profile_from_dict

STEP = 2 * np.pi / np.array([4096, 4096, 8192])


def open_profile(**changes: dict[str, Any]) -> Profile:
    """The paper's rig at 500 Hz without controller; ``motor={"v_max": 5.0}`` changes a section."""
    data = default_profile().to_dict()
    del data["controller"]
    for section, values in changes.items():
        data[section] = {**data[section], **values}
    return profile_from_dict(data)


def flight(
    n: int = 3000, *, seed: int = 1, quantised: bool = True, profile: Profile | None = None
) -> Recording:
    """A rigid body driven by random voltages (held 0.5 s), as a log would show it."""
    rng = np.random.default_rng(seed)
    profile = profile or open_profile()
    dt = profile.dt
    g, m, K_f = profile.geometry, profile.mass, profile.motor.K_f
    m_h = m.m_f + m.m_b
    hold = max(1, round(0.5 / dt))
    V = np.repeat(rng.normal(0, 1.5, (n // hold + 1, 2)), hold, axis=0)[:n]
    F, D = V.sum(1), V[:, 0] - V[:, 1]
    roll, pitch, yaw = np.zeros(n), np.zeros(n), np.zeros(n)
    a_roll = g.L_a * K_f * F / (m.m_w * g.L_w**2 + m_h * g.L_a**2)
    a_pitch = g.L_h * K_f * D / (m_h * g.L_h**2)
    rate = np.zeros(3)
    for k in range(n - 1):
        torque = (a_roll[k] - 1.2 * roll[k], a_pitch[k] - 4 * pitch[k], -1.23 * pitch[k])
        rate = rate * (1 - 0.5 * dt) + dt * np.array(torque)
        roll[k + 1], pitch[k + 1], yaw[k + 1] = np.array([roll[k], pitch[k], yaw[k]]) + dt * rate
    angle = np.column_stack([roll, pitch, yaw])
    if quantised:
        angle = np.rint(angle / STEP) * STEP
    return recording_of_arrays(
        np.arange(n) * dt,
        np.clip(V + profile.motor.V_o, -profile.motor.v_max, profile.motor.v_max),
        angle,
        profile,
        reference=np.column_stack([np.full(n, 0.1), np.zeros(n), np.zeros(n)]),
        voltage_cmd=V + profile.motor.V_o,
        meta={"name": "made-up", "source": "test", "seed": seed},
    )


def changed(recording: Recording, array: str, index: Any, values: Any) -> Recording:
    """Return a copy of ``recording`` in which ``array[index]`` has other values."""
    own = getattr(recording, array).copy()
    own[index] = values
    return replace(recording, **{array: own})


def empty() -> Recording:
    """A recording without samples, as of a flight that ended before its first period."""
    return recording_of_arrays(np.zeros(0), np.zeros((0, 2)), np.zeros((0, 3)), open_profile())


def tick(k: int) -> Row:
    """Row k as the loop passes it; every value identifies its column."""
    counts = (-k, 2 * k, 3 * k)
    sample = Sample(
        sequence=k,
        device_time_s=5 + k * 0.002,
        counts=counts,
        v_applied=(0.0, 0.0),  # of the period that ended: the writer must not take these
        current=(0.25, 0.5),
        flags=Flags.ENABLED | Flags.SATURATED,
        host_time_s=100 + k * 0.002,
    )
    roll, pitch, yaw = (np.array(counts) * STEP).tolist()
    return Row(
        t=k * 0.002,
        sample=sample,
        angle=(roll, pitch, yaw),
        reference=(0.1, 0.2, 0.3),
        limited=(0.01, 0.02, 0.03),
        extra=(0.5, -0.5),
        command=(30.0 + k, -30.0),
        voltage=(24.0, -24.0),
        command_sequence=k + 1,
        applied=(23.9, -23.9),
        lateness=1e-6 * k,
        phase=7,
    )


def write_flight(path: Path, n: int = 300, *, outcome: str | None = "completed") -> Path:
    """A small flight through the writer that the loop uses."""
    with RecordingWriter(path, default_profile(), {"plan": {"roll_deg": 10}, "seed": 3}) as writer:
        for k in range(n):
            writer.append(tick(k))
        if outcome:
            writer.outcome(outcome)
    return path


def csv_text(columns: dict[str, Any]) -> str:
    """A CSV log with these columns; cells are printed as ``repr``, text as it is."""
    cells = [[x if isinstance(x, str) else repr(float(x)) for x in v] for v in columns.values()]
    return (
        "\n".join([",".join(columns), *(",".join(row) for row in zip(*cells, strict=True))]) + "\n"
    )


def log_columns(recording: Recording) -> dict[str, Any]:
    """The contract's columns of a recording, angles in degrees."""
    from heli3dof.recording.columns import export_columns

    return export_columns(recording)
