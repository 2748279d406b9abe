"""Raw logs of two laboratories: sum and difference of the voltages, radians, unnamed rows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from heli3dof.recording.load import load
from heli3dof.recording.logs.import_log import import_log
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import Profile, load_profile, profile_from_dict
from tests.paths import REAL_DATA, needs_real_data

RAW = REAL_DATA / "raw-mat"
RIG_B = {
    "v_front_cmd_V": "(data[3] - data[2])/2",
    "v_back_cmd_V": "(data[3] + data[2])/2",
    "v_front_V": "clip(v_front_cmd_V, -5, 5)",
    "v_back_V": "clip(v_back_cmd_V, -5, 5)",
    "roll_rad": "data[8]",
    "pitch_rad": "-data[6]",
    "yaw_rad": "data[4]",
    "pitch_ref_rad": "-data[1]",
}
RIG_C = RIG_B | {
    "v_front_cmd_V": "(input[1] + 5.48 - input[2])/2",
    "v_back_cmd_V": "(input[1] + 5.48 + input[2])/2",
    "roll_rad": "x_enc[5]",
    "pitch_rad": "-x_enc[3]",
    "yaw_rad": "x_enc[1]",
}
del RIG_C["pitch_ref_rad"]
pytestmark = [needs_real_data, pytest.mark.real_data]


def rig(mapping: dict[str, str] | None = None) -> Profile:
    """Rig B's profile; rig C is of the same kind."""
    profile = load_profile(REAL_DATA / "rig-b" / "profile.toml")
    return profile_from_dict(profile.to_dict() | ({"log": mapping} if mapping else {}))


def file_of_rig_b() -> Path:
    return next((RAW / "rig-b").glob("*.mat"))


def files_of_rig_c() -> list[Path]:
    return [RAW / "rig-c" / "1" / f"{name}.mat" for name in ("input", "x_enc", "ref")]


def converted() -> list[Recording]:
    """Other flights of rig B, which someone else converted."""
    return [load(path, rig()) for path in sorted((REAL_DATA / "rig-b").glob("*.csv"))]


def yaw_torque(r: Recording) -> float:
    """Correlation of the yaw acceleration with pitch: it is the sign of both axes."""
    n = round(0.2 / r.dt)
    yaw = r.angle[:, 2]
    return float(np.corrcoef(yaw[2 * n :] - 2 * yaw[n:-n] + yaw[: -2 * n], r.angle[n:-n, 1])[0, 1])


def pitch_torque(r: Recording) -> float:
    n = round(0.2 / r.dt)
    pitch, V = r.angle[:, 1], r.voltage[n:-n, 0] - r.voltage[n:-n, 1]
    return float(np.corrcoef(pitch[2 * n :] - 2 * pitch[n:-n] + pitch[: -2 * n], V)[0, 1])


def test_a_matrix_of_rig_b_has_the_conventions_of_its_converted_logs() -> None:
    flight = import_log(file_of_rig_b(), rig(RIG_B))
    others = converted()
    for other in others:
        np.testing.assert_allclose(flight.voltage_cmd[0], other.voltage_cmd[0])
        np.testing.assert_allclose(flight.voltage.max(), other.voltage.max())
        np.testing.assert_allclose(flight.angle[0, 0], other.angle[0, 0], atol=1e-4)
        assert flight.dt == pytest.approx(other.dt)
    assert yaw_torque(flight) < -0.8
    assert all(yaw_torque(other) < -0.8 for other in others)
    signs = {np.sign(pitch_torque(each)) for each in [flight, *others]}
    assert len(signs) == 1
    assert flight.has_reference("pitch")
    assert np.corrcoef(flight.reference[:, 1], flight.angle[:, 1])[0, 1] > 0.8


def test_three_files_of_rig_c_are_one_flight() -> None:
    flight = import_log(files_of_rig_c(), rig(), mapping=RIG_C)
    assert np.degrees(flight.angle[0, 0]) == pytest.approx(-23.8, abs=0.05)
    assert flight.voltage.max() == 5
    assert yaw_torque(flight) < -0.8
    assert pitch_torque(flight) > 0
    assert {"ref[1]", "ref[2]", "x_enc[2]"} <= flight.channels.keys()
    assert [log["file"] for log in flight.meta["more_logs"]] == ["x_enc.mat", "ref.mat"]
    assert flight.meta["log_mapping"]["roll_rad"] == "x_enc[5]"
    assert not any("against its voltages" in w for w in flight.meta["warnings"])
