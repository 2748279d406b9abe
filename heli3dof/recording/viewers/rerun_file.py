"""An .rrd file for the viewer Rerun: every column as a curve, and the rig in three dimensions.

Entities: ``/flight/NAME`` for each exported column NAME, with its unit, and ``/rig/base``,
``/rig/arm``, ``/rig/arm/body`` for the frames of `heli3dof.recording.viewers.scene`. Each part of
the rig is an entity below that of its frame: ``/rig/base/base``. The time line is ``t_s``, the
recording's time in s. The default view shows the rig, the angles with references, and the voltages.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from heli3dof.axes import AXES
from heli3dof.recording.columns import unit_of
from heli3dof.recording.recording import Recording
from heli3dof.recording.viewers.scene import (
    ARM,
    BASE,
    BLUE,
    BODY,
    VERMILION,
    parts,
    pivot_height,
    poses,
)
from heli3dof.results import optional

TIME = "t_s"
ENTITIES = {BASE: "/rig/base", ARM: "/rig/arm", BODY: "/rig/arm/body"}
"""Frame → entity path"""
COLOURS = {
    **{f"{axis}_deg": BLUE for axis in AXES},
    **{f"{axis}_ref_deg": VERMILION for axis in AXES},
    "v_front_V": VERMILION,
    "v_back_V": BLUE,
}
"""Column → colour of its curve; Rerun chooses the colours of the other columns"""


def rrd_bytes(recording: Recording, columns: Mapping[str, np.ndarray]) -> bytes:
    """Return the bytes of an .rrd file with a recording's columns and its scene.

    Raises UsageError if rerun-sdk is missing.
    """
    rr = optional("rerun")
    stream = rr.RecordingStream("heli3dof")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "flight.rrd"
        stream.save(path, default_blueprint=_blueprint(recording, columns))
        stream.send_recording_name(recording.name)
        _send_columns(rr, stream, recording, columns)
        _send_scene(rr, stream, recording)
        stream.flush()
        stream.disconnect()
        return path.read_bytes()


def _send_columns(
    rr: Any, stream: Any, recording: Recording, columns: Mapping[str, np.ndarray]
) -> None:
    time = rr.TimeColumn(TIME, duration=recording.t)
    for name, values in columns.items():
        if name == TIME:
            continue
        path = ["flight", name]
        line = rr.SeriesLines(names=name, colors=COLOURS.get(name))
        stream.log(path, line, rr.AnyValues(unit=unit_of(name)), static=True)
        scalars = rr.Scalars.columns(scalars=values.astype(float))
        stream.send_columns(rr.new_entity_path(path), [time], scalars)


def _send_scene(rr: Any, stream: Any, recording: Recording) -> None:
    stream.log("/rig", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    for part in parts(recording.profile):
        shape: Any
        if part.form == "box":
            shape = rr.Boxes3D(
                centers=[part.centre], sizes=[part.size], colors=[part.colour], fill_mode="solid"
            )
        else:
            shape = rr.Cylinders3D(
                centers=[part.centre], lengths=[part.size[2]], radii=[part.size[0] / 2],
                colors=[part.colour], fill_mode="solid",
            )  # fmt: skip
        stream.log(f"{ENTITIES[part.frame]}/{part.name.replace(' ', '_')}", shape, static=True)
    found = poses(recording)
    time = rr.TimeColumn(TIME, duration=recording.t[found.rows])
    frames = ((ARM, found.arm_origin, found.arm), (BODY, found.body_origin, found.body))
    for frame, origin, rotation in frames:
        stream.send_columns(
            ENTITIES[frame],
            [time],
            rr.Transform3D.columns(
                translation=np.tile(origin, (len(rotation), 1)), quaternion=rotation
            ),
        )


def _blueprint(recording: Recording, columns: Mapping[str, np.ndarray]) -> Any:
    rrb = optional("rerun.blueprint")
    L_a = recording.profile.geometry.L_a
    eye = rrb.EyeControls3D(
        position=(2.5 * L_a, -2.5 * L_a, 2 * L_a),
        look_target=(0, 0, pivot_height(recording.profile)),
    )
    groups = {axis: [f"{axis}_deg", f"{axis}_ref_deg"] for axis in AXES}
    groups["voltages"] = ["v_front_V", "v_back_V"]
    plots = [
        rrb.TimeSeriesView(name=title, contents=[f"/flight/{n}" for n in names if n in columns])
        for title, names in groups.items()
        if any(n in columns for n in names)
    ]
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Spatial3DView(origin="/rig", name="rig", eye_controls=eye), rrb.Vertical(*plots)
        ),
        rrb.TimePanel(timeline=TIME, state="collapsed"),
        collapse_panels=True,
    )
