"""A frame is received unchanged or not at all."""

from __future__ import annotations

from binascii import crc_hqx
from struct import Struct

import pytest
from heli3dof_drivers.link.frames import (
    _KINDS,
    INITIAL,
    CommandFrame,
    Estop,
    Frame,
    Poll,
    Splitter,
    check,
    command,
    parse,
    payload,
    wire,
)
from hypothesis import given
from hypothesis import strategies as st

RANGES = {"B": (0, 255), "H": (0, 65535), "h": (-32768, 32767), "I": (0, 2**32 - 1),
          "i": (-(2**31), 2**31 - 1)}  # fmt: skip


def fields(layout: Struct) -> list[st.SearchStrategy]:
    codes = layout.format[1:].replace("16s", "s")
    return [
        st.binary(min_size=16, max_size=16) if c == "s" else st.integers(*RANGES[c]) for c in codes
    ]


@st.composite
def any_frame(draw: st.DrawFn) -> Frame:
    kind = draw(st.sampled_from(list(_KINDS.values())))
    return kind(draw(st.integers(0, 2**32 - 1)), *(draw(f) for f in fields(kind.BODY)))


def test_the_crc_is_the_published_one():
    backwards = crc_hqx(b"987654321", INITIAL)
    assert check(b"123456789") == bytes.fromhex("b129") + backwards.to_bytes(2, "little")


def test_a_command_of_five_volts_by_hand():
    data = payload(CommandFrame(1, 5_000_000, -5_000_000))
    assert data[:-4].hex() == "010301000000404b4c00c0b4b3ff"
    assert command(1, 5_000_000, -5_000_000) == wire(CommandFrame(1, 5_000_000, -5_000_000))


@given(any_frame())
def test_a_frame_is_parsed_as_it_was_sent(frame: Frame):
    sent = wire(frame)
    assert sent.strip(b"\0").count(0) == 0
    assert Splitter().feed(sent) == [frame]


@given(st.lists(any_frame(), max_size=5), st.lists(st.integers(1, 40), min_size=1))
def test_frames_are_found_however_the_bytes_are_split(frames: list[Frame], cuts: list[int]):
    stream = b"".join(wire(f) for f in frames)
    splitter, out, at = Splitter(), [], 0
    while at < len(stream):
        n = cuts[at % len(cuts)]
        out += splitter.feed(stream[at : at + n])
        at += n
    assert out == frames
    assert splitter.malformed == 0


@given(any_frame(), st.data())
def test_up_to_three_wrong_bits_are_detected(frame: Frame, data: st.DataObject):
    whole = payload(frame)
    wrong = bytearray(whole)
    bits = data.draw(
        st.lists(st.integers(0, 8 * len(whole) - 1), min_size=1, max_size=3, unique=True)
    )
    for b in bits:
        wrong[b // 8] ^= 1 << b % 8
    assert check(bytes(wrong[:-4])) != bytes(wrong[-4:])


@given(st.binary(max_size=300), any_frame(), any_frame())
def test_after_any_error_the_second_valid_frame_is_read(noise: bytes, first: Frame, second: Frame):
    read = Splitter().feed(noise + wire(first) + wire(second))
    assert read[-1] == second


@given(st.binary(max_size=60))
def test_an_estop_is_read_after_any_torn_frame(noise: bytes):
    assert Splitter().feed(noise + wire(Estop(5)))[-1] == Estop(5)


@pytest.mark.parametrize("cut", range(1, len(wire(Poll(1))) - 1))
def test_a_torn_frame_is_not_a_frame(cut: int):
    assert parse(wire(Poll(1))[cut:-1]) is None
    assert parse(wire(Poll(1))[:cut]) is None


def test_bytes_without_a_delimiter_are_not_collected():
    splitter = Splitter()
    for _ in range(1000):
        splitter.feed(b"\x01" * 1000)
    assert len(splitter._rest) < 200
    assert splitter.feed(b"\0" + wire(Poll(3))) == [Poll(3)]
