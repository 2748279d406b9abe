"""The table has columns for every identification method, also for those without parameters."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from heli3dof.batch.analyses import ANALYSES, Job
from heli3dof.batch.task import Task
from heli3dof.recording.mcap_files.reader import read_recording
from heli3dof.recording.write import write_recording
from tests.flown import flown
from tests.paths import ROOT


def test_a_black_box_gives_its_fits_and_no_parameters(tmp_path: Path) -> None:
    task = Task.new("identify", "a", {"method": "pbsid", "order": 6}, None)
    job = Job(task, ROOT / "recordings" / "train-1.mcap", tmp_path)
    row = ANALYSES["identify"].columns(ANALYSES["identify"].run(job))
    assert row["method"] == "pbsid"
    assert row["fit_one_step_roll_percent"] > 70
    assert not any(name.startswith("J_") for name in row)


def test_identify_fits_no_bad_data(tmp_path: Path) -> None:
    """The row names the check, and no parameters."""
    r = read_recording(ROOT / "recordings" / "train-1.mcap")
    path = write_recording(replace(r, angle=r.angle * [1, -1, 1]), tmp_path / "reversed.mcap")
    job = Job(Task.new("identify", "a", {}, None), path, tmp_path)
    row = ANALYSES["identify"].columns(ANALYSES["identify"].run(job))
    assert row == {"faults": "encoder.sign"}


def test_a_parameter_at_the_bound_of_no_effect_is_zero_within_its_error(tmp_path: Path) -> None:
    """So `fleet` finds a lag that appears. The simulated rig has no motor lag."""
    path = write_recording(flown("rich", 20.0, device="mock:?speed=max"), tmp_path / "no-lag.mcap")
    options = {"terms": ["motor.lag", "friction.viscous.yaw"]}
    job = Job(Task.new("identify", "a", options, None), path, tmp_path)
    document = ANALYSES["identify"].run(job)
    row = ANALYSES["identify"].columns(document)
    assert document["absent"] == ["motor.lag.time_constant_s"]
    assert row["absent"] == "motor.lag.time_constant_s"
    assert row["motor.lag.time_constant_s"] == 0
    assert row["motor.lag.time_constant_s_std"] > 0
    assert row["friction.viscous.yaw.damping_Nms_per_rad_std"] > 0
