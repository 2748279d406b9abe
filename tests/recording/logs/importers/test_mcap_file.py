"""MCAP files of other programs."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mcap.writer import Writer

from heli3dof.errors import RecordingError
from heli3dof.recording.logs.import_log import import_log
from heli3dof.recording.mcap_files.reader import read_recording
from tests.recording.make import flight, log_columns, open_profile


def json_file(path: Path, topics: dict[str, list[tuple[int, dict]]], encoding="json") -> Path:
    with path.open("wb") as out:
        writer = Writer(out)
        writer.start()
        for topic, messages in topics.items():
            schema = writer.register_schema(f"my.{topic}", "jsonschema", b"{}")
            channel = writer.register_channel(topic, encoding, schema)
            for when, message in messages:
                writer.add_message(channel, when, json.dumps(message).encode(), when)
        writer.finish()
    return path


def rows(n: int = 500) -> tuple[list[dict], list[int]]:
    columns = log_columns(flight(n))
    messages = [{name: float(v[k]) for name, v in columns.items()} for k in range(n)]
    return messages, [10**18 + k * 2_000_000 for k in range(n)]


def test_json_messages_with_the_contracts_columns_are_read(tmp_path: Path) -> None:
    messages, times = rows()
    path = json_file(tmp_path / "a.mcap", {"/log": list(zip(times, messages, strict=True))})
    r = read_recording(path, open_profile())
    np.testing.assert_allclose(r.angle, flight(500).angle, atol=1e-12)
    np.testing.assert_array_equal(r.voltage, flight(500).voltage)
    assert r.meta["source"] == "import"


def test_without_t_s_the_log_time_is_used_with_a_warning(tmp_path: Path) -> None:
    messages, times = rows()
    for message in messages:
        del message["t_s"]
    path = json_file(tmp_path / "a.mcap", {"/log": list(zip(times, messages, strict=True))})
    r = read_recording(path, open_profile())
    np.testing.assert_allclose(r.t, np.arange(500) * 0.002, atol=1e-12)
    assert any("log time" in w for w in r.meta["warnings"])


def test_topics_with_equal_log_times_are_joined_and_others_give_a_warning(tmp_path: Path) -> None:
    messages, times = rows()
    angles = [{"roll_deg": m.pop("roll_deg")} for m in messages]
    pitch = [{"pitch_deg": m.pop("pitch_deg")} for m in messages]
    path = json_file(
        tmp_path / "a.mcap",
        {
            "/volts": list(zip(times, messages, strict=True)),
            "/roll": list(zip(times, angles, strict=True)),
            "/pitch": list(zip(times[1:], pitch[1:], strict=True)),
        },
    )
    r = read_recording(path, open_profile())
    assert r.axes == ("roll", "yaw")
    assert any("pitch_deg on /pitch was ignored" in w for w in r.meta["warnings"])


def test_protobuf_messages_are_decoded_from_the_files_own_schema(tmp_path: Path) -> None:
    messages, times = rows(300)
    file = descriptor_pb2.FileDescriptorProto(name="x.proto", package="lab", syntax="proto3")
    kind = file.message_type.add(name="Row")
    for i, name in enumerate(messages[0]):
        # float, and numbers beyond 15: nothing like our own layout
        kind.field.add(name=name, number=20 + i, label=1, type=1)
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    row = message_factory.GetMessageClass(pool.FindMessageTypeByName("lab.Row"))
    path = tmp_path / "a.mcap"
    with path.open("wb") as out:
        writer = Writer(out)
        writer.start()
        files = descriptor_pb2.FileDescriptorSet(file=[file]).SerializeToString()
        schema = writer.register_schema("lab.Row", "protobuf", files)
        channel = writer.register_channel("/rig", "protobuf", schema)
        for when, message in zip(times, messages, strict=True):
            writer.add_message(channel, when, row(**message).SerializeToString(), when)
        writer.finish()
    r = read_recording(path, open_profile())
    np.testing.assert_allclose(r.angle, flight(300).angle, atol=1e-12)


def test_an_mcap_without_the_columns_is_refused_with_its_topics(tmp_path: Path) -> None:
    path = json_file(tmp_path / "a.mcap", {"/imu": [(0, {"ax": 1})], "/gps": [(0, {"lat": 2})]})
    with pytest.raises(RecordingError, match=r"/imu \(my\./imu\), /gps"):
        read_recording(path)


def test_an_unknown_encoding_is_named(tmp_path: Path) -> None:
    path = json_file(tmp_path / "a.mcap", {"/odom": [(0, {})]}, encoding="cdr")
    with pytest.raises(RecordingError, match=r"Not decoded: /odom \(cdr\)"):
        read_recording(path)


def test_a_foreign_file_needs_a_profile(tmp_path: Path) -> None:
    messages, times = rows(50)
    path = json_file(tmp_path / "a.mcap", {"/log": list(zip(times, messages, strict=True))})
    with pytest.raises(RecordingError, match="no profile") as caught:
        read_recording(path)
    assert "profile=" in caught.value.fix


def test_an_undecodable_message_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with path.open("wb") as out:
        writer = Writer(out)
        writer.start()
        channel = writer.register_channel("/log", "json", 0)
        writer.add_message(channel, 0, b'{"v_front_V": 1, "v_back_V": 1}', 0)
        writer.add_message(channel, 1, b"{", 1)
        writer.finish()
    with pytest.raises(RecordingError, match="message 2 on /log cannot be decoded"):
        read_recording(path)


def test_another_programs_mcap_can_be_imported(tmp_path: Path) -> None:
    messages, times = rows()
    path = json_file(tmp_path / "a.mcap", {"/log": list(zip(times, messages, strict=True))})
    assert import_log(path, open_profile()).digest == read_recording(path, open_profile()).digest
    with pytest.raises(RecordingError, match="contains no profile"):
        import_log(path, None)
