"""The table has columns for every identification method, also for those without parameters."""

from __future__ import annotations

from pathlib import Path

from heli3dof.batch.analyses import ANALYSES, Job
from tests.paths import ROOT


def test_a_black_box_gives_its_fits_and_no_parameters(tmp_path: Path) -> None:
    job = Job(
        ROOT / "recordings" / "train-1.mcap", "a", tmp_path, {"method": "pbsid", "order": 6}, None
    )
    row = ANALYSES["identify"].columns(ANALYSES["identify"].run(job))
    assert row["method"] == "pbsid"
    assert row["fit_one_step_roll_percent"] > 70
    assert not any(name.startswith("J_") for name in row)
