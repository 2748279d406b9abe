"""An MCAP file for the viewer Foxglove: a recording's messages, and the rig in three dimensions.

Besides the recording's topics, the file has JSON messages with Foxglove's own schemas:

    /heli3dof/scene        foxglove.SceneUpdate, once: the parts of the rig
    /heli3dof/transforms   foxglove.FrameTransforms, 60 per second: the poses of arm and body
    /heli3dof/log          foxglove.Log: source, warnings, and how the flight ended

heli3dof reads such a file like the recording itself. heli3dof does not record a flight in this
form, because a transform costs more than a row of the recording. The encoding of a transform takes
15 µs, that of a row 2 µs. The size of a transform is 0.5 kB, that of a row 0.3 kB.
"""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from typing import Any

import numpy as np

from heli3dof.recording.mcap_files.mcap_writer import LIBRARY, to_json
from heli3dof.recording.mcap_files.schema import SAMPLE
from heli3dof.recording.recording import Recording
from heli3dof.recording.viewers.scene import ARM, BASE, BODY, Part, parts, poses
from heli3dof.recording.write import encode, metadata

Message = dict[str, Any]
TOPICS = {
    "/heli3dof/scene": "foxglove.SceneUpdate",
    "/heli3dof/transforms": "foxglove.FrameTransforms",
    "/heli3dof/log": "foxglove.Log",
}
"""Topic → name of its schema"""
INFO, WARNING = 2, 3
"""Levels of foxglove.Log"""
NO_ROTATION = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
PRIMITIVES = ("arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models")


def foxglove_bytes(recording: Recording) -> bytes:
    """Return the bytes of an MCAP file with a recording and its three-dimensional scene."""
    from mcap.writer import Writer

    form, rows, absent = encode(recording)
    times = rows[SAMPLE.name]["log_time"].tolist()
    out = io.BytesIO()
    writer = Writer(out)
    writer.start(profile="", library=LIBRARY)
    for name, record in metadata(recording, absent).items():
        writer.add_metadata(name, {key: to_json(value) for key, value in record.items()})
    extra = list(messages(recording, times))
    queue: list[tuple[int, int, int, bytes]] = []  # log time, channel, number, payload
    for layout in form.layouts:
        schema = writer.register_schema(layout.full_name, "protobuf", layout.descriptor_set)
        channel = writer.register_channel(layout.topic, "protobuf", schema, layout.about)
        payload = rows[layout.name][list(layout.payload.names or ())].astype(layout.payload)
        records = payload.view(np.uint8).reshape(len(payload), -1)
        queue += [(time, channel, k, bytes(records[k])) for k, time in enumerate(times)]
    for topic in dict.fromkeys(at for at, _, _ in extra):
        own = [(time, message) for at, time, message in extra if at == topic]
        example = _json(json_schema(own[0][1]))
        schema = writer.register_schema(TOPICS[topic], "jsonschema", example)
        channel = writer.register_channel(topic, "json", schema)
        queue += [(time, channel, k, _json(message)) for k, (time, message) in enumerate(own)]
    for time, channel, k, data in sorted(queue):
        writer.add_message(channel, time, data, time, k)
    writer.finish()  # type: ignore[no-untyped-call]
    return out.getvalue()


def messages(recording: Recording, times: list[int]) -> Iterator[tuple[str, int, Message]]:
    """Yield topic, log time and content of each message; ``times``: the rows' log times (ns)."""
    scene, transforms, log = TOPICS
    first, last = times[0], times[-1]
    entities = [entity(part, first) for part in parts(recording.profile)]
    yield scene, first, {"deletions": [], "entities": entities}
    found = poses(recording)
    for row, arm, body in zip(
        found.rows.tolist(), found.arm.tolist(), found.body.tolist(), strict=True
    ):
        pair = [
            _transform(times[row], BASE, ARM, found.arm_origin, arm),
            _transform(times[row], ARM, BODY, found.body_origin, body),
        ]
        yield transforms, times[row], {"transforms": pair}
    meta = recording.meta
    about = f"{meta.get('source', 'recording')} {recording.name}, rig {recording.profile.name}"
    yield log, first, _log(first, INFO, about)
    for warning in meta.get("warnings", ()):
        yield log, first, _log(first, WARNING, str(warning))
    if "outcome" in meta:
        detail = meta.get("outcome_details", {}).get("detail")
        level = INFO if meta["outcome"] == "completed" else WARNING
        ended = f"{meta['outcome']}: {detail}" if detail else str(meta["outcome"])
        yield log, last, _log(last, level, ended)


def entity(part: Part, time: int) -> Message:
    """Return a part of the rig as a foxglove.SceneEntity with the time stamp ``time`` (ns)."""
    red, green, blue = part.colour
    primitive = {
        "pose": {"position": _vector(part.centre), "orientation": NO_ROTATION},
        "size": _vector(part.size),
        "color": {"r": red, "g": green, "b": blue, "a": 1.0},
    }
    if part.form == "cylinder":
        primitive |= {"bottom_scale": 1.0, "top_scale": 1.0}
    shapes: Message = {name: [] for name in PRIMITIVES}
    shapes["cubes" if part.form == "box" else "cylinders"] = [primitive]
    return {
        "timestamp": _time(time),
        "frame_id": part.frame,
        "id": part.name,
        "lifetime": {"sec": 0, "nsec": 0},
        "frame_locked": True,
        "metadata": [],
        **shapes,
    }


def json_schema(example: Any) -> dict[str, Any]:
    """Return the JSON schema of the message ``example``, whose lists contain only dicts.

    >>> json_schema({"sec": 0})
    {'type': 'object', 'properties': {'sec': {'type': 'integer'}}}
    """
    if isinstance(example, dict):
        fields = {name: json_schema(value) for name, value in example.items()}
        return {"type": "object", "properties": fields}
    if isinstance(example, list):
        merged: dict[str, Any] = {}
        for item in example:
            merged |= {key: value for key, value in item.items() if value or key not in merged}
        return {"type": "array", "items": json_schema(merged)}
    kinds = {bool: "boolean", int: "integer", float: "number", str: "string"}
    return {"type": kinds[type(example)]}


def _transform(
    time: int, parent: str, child: str, origin: tuple[float, ...], rotation: list[float]
) -> Message:
    return {
        "timestamp": _time(time),
        "parent_frame_id": parent,
        "child_frame_id": child,
        "translation": _vector(origin),
        "rotation": dict(zip("xyzw", rotation, strict=True)),
    }


def _log(time: int, level: int, message: str) -> Message:
    return {
        "timestamp": _time(time),
        "level": level,
        "message": message,
        "name": LIBRARY,
        "file": "",
        "line": 0,
    }


def _vector(values: tuple[float, ...]) -> dict[str, float]:
    return {axis: float(value) for axis, value in zip("xyz", values, strict=True)}


def _time(time: int) -> dict[str, int]:
    return {"sec": time // 10**9, "nsec": time % 10**9}


def _json(message: Message) -> bytes:
    return json.dumps(message).encode()
