"""The .rrd file, read again with Rerun's own reader; skipped without rerun-sdk."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from heli3dof.recording.columns import export_columns
from heli3dof.recording.logs.export import export
from heli3dof.recording.recording import Recording
from heli3dof.recording.viewers.scene import poses
from tests.recording.make import flight

pytest.importorskip("rerun")


@pytest.fixture(scope="module")
def recording() -> Recording:
    return flight(500)


@pytest.fixture(scope="module")
def entities(recording: Recording, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Entity path → its columns by name, as lists."""
    from rerun.chunk import RrdReader

    path = export(recording, tmp_path_factory.mktemp("rrd") / "a.rrd")
    found: dict[str, Any] = {}
    for chunk in RrdReader(path).stream().to_chunks():
        batch = chunk.to_record_batch()
        found.setdefault(chunk.entity_path, {}).update(batch.to_pydict())
    return found


def test_every_column_is_a_curve_over_seconds(
    recording: Recording, entities: dict[str, Any]
) -> None:
    columns = export_columns(recording)
    for name in columns.keys() - {"t_s"}:
        found = entities[f"/flight/{name}"]
        np.testing.assert_array_equal(
            np.ravel(found["Scalars:scalars"]), columns[name].astype(float)
        )
        times = np.array([t.total_seconds() for t in found["t_s"]])
        np.testing.assert_allclose(times, recording.t, atol=1e-6)


def test_the_unit_of_a_curve_is_stored_with_it(entities: dict[str, Any]) -> None:
    assert entities["/flight/roll_deg"]["unit"] == [["deg"]]
    assert entities["/flight/v_front_V"]["unit"] == [["V"]]


def test_the_transforms_are_the_poses(recording: Recording, entities: dict[str, Any]) -> None:
    pose = poses(recording)
    for path, rotation in (("/rig/arm", pose.arm), ("/rig/arm/body", pose.body)):
        found = np.squeeze(entities[path]["Transform3D:quaternion"])
        np.testing.assert_allclose(found, rotation, atol=1e-6)
    assert "/rig/arm/body/front_rotor" in entities
