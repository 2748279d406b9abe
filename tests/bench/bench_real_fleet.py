"""Identifies the public logs of two real rigs as one fleet; stores what `fleet` prints.

The logs are imported with their rig's profile, as `heli3dof import` does, into a folder that is
deleted afterwards.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from heli3dof.batch.engines.processes import Processes
from heli3dof.batch.output_folder import OutputFolder
from heli3dof.batch.run_batch import run_batch, tasks_of
from heli3dof.batch.sources import find
from heli3dof.fleet.analyse import analyse
from heli3dof.fleet.tracks import read_rows
from heli3dof.recording.load import load
from heli3dof.recording.write import write_recording
from heli3dof.rig.profile import load_profile
from tests import paths
from tests.bench import Figure
from tests.pages.fleet_page import REAL, printed

TITLE = "Two real rigs as a fleet"
INTRO = """`batch identify` on all logs of the two rigs of the case studies, then `fleet`. Measured
only on machines with the recordings."""
RIGS = ("rig-a", "rig-b")


def measure() -> list[Figure]:
    if not paths.REAL_DATA.is_dir():
        return []
    with tempfile.TemporaryDirectory() as name:
        logs, results = Path(name) / "logs", Path(name) / "rigs"
        logs.mkdir()
        for rig in RIGS:
            folder = paths.REAL_DATA / rig
            profile = load_profile(folder / "profile.toml")
            for log in sorted(folder.glob("*.csv")):
                write_recording(load(log, profile), logs / f"{log.stem}.mcap")
        tasks = list(tasks_of("identify", find([str(logs)]), [{}], None, ""))
        with OutputFolder(results, resume=False) as folder:
            run_batch(tasks, folder, Processes())
        fleet = analyse(read_rows(results))
    REAL.write_text(printed("rigs", fleet) + "\n", encoding="utf-8")
    used = dict.fromkeys(RIGS, 0)
    for r in fleet.tracks():
        used[r.track.rig] = max(used[r.track.rig], len(r.track.y))
    return [
        Figure(
            f"{rig}: flights that `fleet` uses", str(used[rig]),
            how=f"of {sum(1 for b in fleet.bad if b.rig == rig) + used[rig]} logs",
        )
        for rig in RIGS
    ]  # fmt: skip
