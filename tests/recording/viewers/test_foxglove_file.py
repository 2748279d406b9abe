"""The MCAP file for Foxglove: its messages, and the recording in it."""

from __future__ import annotations

import importlib
import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from google.protobuf.json_format import ParseDict
from mcap.reader import make_reader

from heli3dof.recording.logs.export import export
from heli3dof.recording.mcap_files.reader import read_recording
from heli3dof.recording.mcap_files.schema import FORMAT
from heli3dof.recording.recording import Recording
from heli3dof.recording.viewers.foxglove_file import TOPICS
from tests.recording.make import flight, write_flight

N = 500


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    return read_recording(write_flight(tmp_path_factory.mktemp("flown") / "a.mcap", N))


@pytest.fixture(scope="module")
def file(recording: Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export(recording, tmp_path_factory.mktemp("seen") / "a.mcap")


def messages(file: Path) -> list[tuple[str, str, dict[str, Any]]]:
    """Schema, its text and content of every JSON message."""
    with file.open("rb") as stream:
        return [
            (schema.name, schema.data.decode(), json.loads(message.data))
            for schema, channel, message in make_reader(stream).iter_messages()
            if schema is not None and channel.message_encoding == "json"
        ]


def test_heli3dof_reads_the_same_recording(recording: Recording, file: Path) -> None:
    back = read_recording(file)
    assert back.digest == recording.digest
    assert back.meta == {"format": FORMAT, **recording.meta}
    assert back.profile == recording.profile
    for name, values in recording.channels.items():
        np.testing.assert_array_equal(back.channels[name], values)


def test_the_topics_of_the_recording_stay(file: Path) -> None:
    with file.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    counts = {
        channel.topic: summary.statistics.channel_message_counts[number]
        for number, channel in summary.channels.items()
    }
    assert counts["/heli3dof/sample"] == counts["/heli3dof/command"] == N
    assert counts["/heli3dof/scene"] == 1
    assert counts["/heli3dof/transforms"] == 60
    assert set(TOPICS) < set(counts)


def test_messages_have_the_fields_of_foxglove_s_own_schemas(file: Path) -> None:
    found = messages(file)
    assert {name for name, _, _ in found} == set(TOPICS.values())
    for name, _, message in found:
        ParseDict(_protobuf_json(message), _foxglove_type(name))  # refuses unknown fields and types


def test_every_message_fits_the_schema_in_the_file(file: Path) -> None:
    for _, schema, message in messages(file):
        check(message, json.loads(schema))


def test_the_log_states_how_the_flight_ended(tmp_path: Path) -> None:
    made = flight(50)
    made.meta.update(  # type: ignore[attr-defined]
        warnings=["a gap of 0.1 s"], outcome="tripped", outcome_details={"detail": "roll too low"}
    )
    log = [m for name, _, m in messages(export(made, tmp_path / "a.mcap")) if name.endswith("Log")]
    assert [(m["level"], m["message"]) for m in log] == [
        (2, "test made-up, rig table-1"),
        (3, "a gap of 0.1 s"),
        (3, "tripped: roll too low"),
    ]


def test_an_imported_log_without_an_outcome_can_be_watched(tmp_path: Path) -> None:
    made = flight(50)
    made.channels["gust m/s"] = np.linspace(0, 1, 50)  # type: ignore[index]
    back = read_recording(export(made, tmp_path / "a.mcap"))
    np.testing.assert_array_equal(back.channels["gust m/s"], made.channels["gust m/s"])
    np.testing.assert_array_equal(back.angle, made.angle)


def check(value: Any, schema: dict[str, Any]) -> None:
    """Foxglove's reader: every object has ``properties``, every list ``items`` of one type."""
    kind = {dict: "object", list: "array", int: "integer", float: "number", str: "string"}
    assert schema["type"] == ("boolean" if isinstance(value, bool) else kind[type(value)])
    if isinstance(value, dict):
        for name, content in value.items():
            check(content, schema["properties"][name])
    elif isinstance(value, list):
        assert schema["items"]["type"] == "object"
        for item in value:
            check(item, schema["items"])


def _foxglove_type(name: str) -> Any:
    package, kind = name.split(".")
    module = importlib.import_module(f"{package}_schemas_protobuf.{kind}_pb2")
    return getattr(module, kind)()


def _protobuf_json(value: Any) -> Any:
    """Times and durations in protobuf's own JSON form: text."""
    if isinstance(value, list):
        return [_protobuf_json(item) for item in value]
    if not isinstance(value, dict):
        return value
    changed = {name: _protobuf_json(content) for name, content in value.items()}
    if "timestamp" in value:
        assert 0 <= value["timestamp"]["nsec"] < 10**9
        changed["timestamp"] = datetime.fromtimestamp(value["timestamp"]["sec"], UTC).isoformat()
    if "lifetime" in value:
        changed["lifetime"] = f"{value['lifetime']['sec']}s"
    return changed
