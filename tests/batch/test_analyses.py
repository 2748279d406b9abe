"""The table has columns for every identification method, also for those without parameters."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from heli3dof.batch.analyses import ANALYSES, Job
from heli3dof.batch.run_task import run_task
from heli3dof.batch.task import Task
from heli3dof.recording.mcap_files.reader import read_recording
from heli3dof.recording.write import write_recording
from tests.flown import flown
from tests.paths import ROOT
from tests.recording.make import write_flight


def test_a_black_box_gives_its_fits_and_no_parameters(tmp_path: Path) -> None:
    task = Task.new("identify", "a", {"method": "pbsid", "order": 6}, None)
    job = Job(task, ROOT / "recordings" / "train-1.mcap", tmp_path)
    row = ANALYSES["identify"].columns(ANALYSES["identify"].run(job))
    assert row["method"] == "pbsid"
    assert row["fit_one_step_roll_percent"] > 70
    assert not any(name.startswith("J_") for name in row)


def test_recover_copies_the_intact_part_of_a_file_with_wrong_bytes(tmp_path: Path) -> None:
    path = write_flight(tmp_path / "a.mcap", 500)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    row = run_task(Task.new("recover", "a", {}, None, source=str(path))).row
    assert (row["exit_code"], row["torn"], row["chunks_damaged"]) == (0, True, 1)


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
