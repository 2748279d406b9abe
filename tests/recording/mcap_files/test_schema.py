"""The messages are legal protobuf, and packed structs."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from hypothesis import given, settings
from hypothesis import strategies as st

from heli3dof.recording.mcap_files.schema import (
    COMMAND,
    SAMPLE,
    Layout,
    RowFormat,
    RowPacker,
    tag_value,
)
from tests.paths import ROOT

HEADER = 31  # opcode 1, length 8, channel 2, sequence 4, log and publish time 8 each


def protobuf_class(layout: Layout) -> type:
    """The message class that google.protobuf makes of our hand-written descriptor."""
    files = descriptor_pb2.FileDescriptorSet.FromString(layout.descriptor_set)
    assert files.SerializeToString() == layout.descriptor_set
    pool = descriptor_pool.DescriptorPool()
    for file in files.file:
        pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(layout.full_name))


values = {
    "double": st.floats(allow_nan=False),
    "fixed32": st.integers(0, 2**32 - 1),
    "sfixed32": st.integers(-(2**31), 2**31 - 1),
}
rows = st.tuples(
    *(st.tuples(*(values[c.kind] for c in layout.columns)) for layout in (SAMPLE, COMMAND))
)


@settings(max_examples=50, deadline=None)
@given(rows)
def test_protobuf_reads_packed_structs(row: tuple[tuple, tuple]) -> None:
    data = RowPacker()(7, 123456789, *row)
    form = RowFormat()
    assert len(data) == form.stride
    parsed = form.parse(data)
    assert parsed is not None
    for layout, offset, expected in zip((SAMPLE, COMMAND), form.offsets, row, strict=True):
        payload = data[offset + HEADER :][: layout.payload.itemsize]
        message = protobuf_class(layout).FromString(payload)
        got = tuple(getattr(message, c.name) for c in layout.columns)
        assert got == expected
        assert tuple(parsed[layout.name][c.name][0] for c in layout.columns) == expected


def test_zeros_are_written_too_so_that_every_message_has_the_same_length() -> None:
    zeros = RowPacker()(0, 0, [0] * len(SAMPLE.columns), [0] * len(COMMAND.columns))
    sample = 10 * 8 + 3 * 4 + 2 * 4 + 15  # doubles, counts, flags and sequence, tags
    command = 13 * 8 + 2 * 4 + 15
    assert len(zeros) == RowFormat().stride == 31 + sample + 31 + command


def test_tags_are_one_byte_and_column_names_end_in_units() -> None:
    unitless = {"roll_count", "pitch_count", "yaw_count", "flags", "sequence", "phase",
                "command_sequence"}  # fmt: skip
    for layout in (SAMPLE, COMMAND):
        assert len(layout.columns) < 16
        for column in layout.columns:
            assert column.name in unitless or column.name.endswith(("_s", "_rad", "_V", "_A"))


def test_the_first_bytes_of_a_sample_equal_the_worked_example() -> None:
    data = RowPacker()(0, 0, [1.0, *[0] * 14], [0] * 15)
    # opcode 5; length of what follows; channel 1; then t_s is field 1 of wire type 1: tag 0x09
    assert data[0] == 5
    assert struct.unpack_from("<QH", data, 1) == (22 + SAMPLE.payload.itemsize, 1)
    assert data[HEADER : HEADER + 9] == b"\x09" + struct.pack("<d", 1.0)


@pytest.mark.parametrize("at", [0, 1, 9, HEADER, HEADER + 9])
def test_a_wrong_tag_or_header_is_noticed(at: int) -> None:
    data = bytearray(RowPacker()(0, 0, [1.0] * 6 + [1] * 3 + [1.0] * 4 + [1] * 2, [0] * 15) * 3)
    assert RowFormat().parse(bytes(data)) is not None
    data[RowFormat().stride + at] ^= 1
    assert RowFormat().parse(bytes(data)) is None


def test_channels_may_have_any_names_and_more_than_fifteen() -> None:
    names = [f"x{i}" for i in range(30)] + ["a b", "a-b", "A b", "µ", "3rd", "tag1", "opcode", ""]
    form = RowFormat(names)
    layout = form.layouts[-1]
    row = form.empty(1)
    for i, column in enumerate(layout.columns):
        row["Channels"][column.name] = i + 0.5
    message = protobuf_class(layout).FromString(row["Channels"].tobytes()[HEADER:])
    got = [getattr(message, c.proto_name) for c in layout.columns]
    np.testing.assert_array_equal(got, np.arange(len(names)) + 0.5)


def test_the_page_on_recordings_names_every_field_and_every_first_byte() -> None:
    page = (ROOT / "docs" / "reference" / "recording.md").read_text()
    for layout in (SAMPLE, COMMAND):
        assert f"`{layout.full_name}`" in page
        assert f"`{layout.topic}`" in page
        for column in layout.columns:
            assert f"`{column.name}`" in page, column.name
    bytes_of_a_sample = page.split("sample   ")[1].split("115 bytes")[0].split()
    expected: list[str] = []
    for number, column in enumerate(SAMPLE.columns, 1):
        expected += [f"{tag_value(number, column.kind):02x}", column.name]
    assert bytes_of_a_sample == expected
    assert (SAMPLE.payload.itemsize, COMMAND.payload.itemsize) == (115, 127)
