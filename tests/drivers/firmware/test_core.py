"""The firmware's core on a virtual clock, written only from docs/reference/protocol.md."""

from __future__ import annotations

import re

import pytest
from heli3dof_drivers.emulator.endpoint import Endpoint
from heli3dof_drivers.link.frames import (
    Ack,
    Arm,
    CommandFrame,
    Disarm,
    Estop,
    Frame,
    Hello,
    IdentityFrame,
    Poll,
    Report,
    SampleFrame,
    Splitter,
    Status,
    payload,
    wire,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.drivers.emulator.still import still_endpoint
from tests.paths import ROOT

from .building import build, run, sanitizers

U32 = st.integers(0, 2**32 - 1)
I32 = st.integers(-(2**31), 2**31 - 1)
NUMBER = st.one_of(st.integers(0, 12), U32)
MICROVOLTS = st.one_of(st.integers(-25_000_000, 25_000_000), I32)


def test_cases_that_the_transcripts_do_not_cover():
    assert len(run("heli3dof-unit")) >= 16


def test_the_fuzz_harness_holds_under_a_sanitizer():
    if not sanitizers():
        pytest.skip("needs a compiler with -fsanitize=address,undefined: apt-get install gcc")
    assert "every statement held" in run("heli3dof-fuzz", "2")[-1]


def transcripts() -> dict[str, list[str]]:
    """The transcripts in the file that protocol.md names, without comments."""
    file = ROOT / "tests" / "drivers" / "link" / "golden_transcripts.txt"
    golden = file.read_text(encoding="utf-8").split("-->\n")[1].split("\n<!--")[0]
    blocks = re.findall(r"\[(\w+)\]\n(.*?)(?:\n\n|\Z)", golden, re.DOTALL)
    return {
        name: [line.split("#")[0].strip() for line in body.splitlines()] for name, body in blocks
    }


@pytest.mark.parametrize("name", sorted(transcripts()))
def test_it_answers_the_golden_transcript_byte_by_byte(name: str):
    lines = transcripts()[name]
    requests = [line for line in lines if " < " not in line]
    answers = [line for line in lines if " < " in line]
    assert requests
    assert answers
    assert run("heli3dof-replay", text="\n".join(requests) + "\n") == answers


@st.composite
def frames(draw: st.DrawFn) -> Frame:
    """Any frame of either direction."""
    kind = draw(st.sampled_from((Hello, Arm, CommandFrame, Poll, Estop, Ack, SampleFrame, Report)))
    values = [draw(U32)]
    for code in kind.BODY.format.lstrip("<"):
        low = -(1 << {"h": 15, "i": 31}.get(code, 0)) if code in "hi" else 0
        high = {"B": 2**8, "H": 2**16, "h": 2**15, "i": 2**31, "I": 2**32}[code] - 1
        values.append(draw(st.integers(low, high)))
    return kind(*values)


def damaged(draw: st.DrawFn, data: bytes) -> bytes:
    what = draw(st.sampled_from(("cut", "flip", "insert", "twice")))
    at = draw(st.integers(0, len(data) - 1))
    if what == "cut":
        return data[:at] + data[at + draw(st.integers(1, 9)) :]
    if what == "flip":
        return data[:at] + bytes([data[at] ^ (1 << draw(st.integers(0, 7)))]) + data[at + 1 :]
    if what == "insert":
        return data[:at] + draw(st.binary(min_size=1, max_size=9)) + data[at:]
    return data + data


@st.composite
def lines(draw: st.DrawFn) -> bytes:
    """Frames, valid and corrupted, with noise between them."""
    out = b""
    for _ in range(draw(st.integers(1, 12))):
        choice = draw(st.sampled_from(("frame", "frame", "damaged", "noise", "long")))
        if choice == "noise":
            out += draw(st.binary(max_size=40))
        elif choice == "long":
            out += b"\7" * draw(st.integers(120, 300)) + b"\0"
        else:
            data = wire(draw(frames()))
            out += data if choice == "frame" else damaged(draw, data)
    return out + b"\0"


@given(lines())
@settings(max_examples=150, deadline=None)
def test_host_and_firmware_find_the_same_frames_in_the_same_bytes(data: bytes):
    splitter = Splitter()
    taken = [payload(frame).hex() for frame in splitter.feed(data)]
    result = run("heli3dof-replay", "--pieces", text=data.hex() + "\n")
    assert [line.split()[1] for line in result if line.startswith("taken")] == taken
    assert len(result) - len(taken) == splitter.malformed


PAUSE = b"!"
"""Instead of a host's bytes: the device paused until this time"""


def until(device: Endpoint, now: int) -> bytes:
    """Called at every due time, as the replay is."""
    out = b""
    while (instant := device.next_us()) is not None and instant <= now:
        out += device.tick(instant)
    return out + device.tick(now)


def replies(device: Endpoint, now: int, data: bytes) -> bytes:
    if data == PAUSE:
        device.held_up(now)
        return device.tick(now)
    return until(device, now) + device.receive(now, data)


@st.composite
def dialogues(draw: st.DrawFn) -> list[tuple[int, bytes]]:
    """Bytes of a host, or pauses, with their times; the Python device gives the ticket."""
    device, splitter = still_endpoint(), Splitter()
    now, ticket, spoken = 0, 1, []
    for _ in range(draw(st.integers(1, 25))):
        now += draw(st.sampled_from((0, 0, 1, 499, 2000, 50_000, 100_001, 150_000, 2_000_000)))
        now += draw(st.integers(0, 3000))
        kind = draw(
            st.sampled_from((Hello, Arm, Arm, CommandFrame, CommandFrame, Poll, Disarm, Estop,
                             Status, None, PAUSE))
        )  # fmt: skip
        if kind is PAUSE:
            data = PAUSE
            # The emulated device neglects a delay of less than a period (here 60 ms at most).
            now = max(now, (device.next_us() or 0) + 60_000)
        elif kind is None:
            data = draw(st.one_of(lines(), st.binary(max_size=12)))
        elif kind is Arm:
            wrong = draw(st.sampled_from((0, 0, 0, 1, -1)))
            period = draw(st.sampled_from((0, 0, 499, 500, 10_000, 60_000, 3_000_000)))
            watchdog = draw(st.sampled_from((0, 0, 1, 4000, 100_000, 10**6, 10**6 + 1)))
            data = wire(Arm(draw(NUMBER), (ticket + wrong) % 2**32, period, watchdog))
        elif kind is CommandFrame:
            data = wire(CommandFrame(draw(NUMBER), draw(MICROVOLTS), draw(MICROVOLTS)))
        elif kind is Hello:
            data = wire(Hello(draw(NUMBER), draw(st.integers(0, 3)), draw(st.integers(0, 3))))
        elif kind is Estop:
            data = wire(Estop(draw(NUMBER), draw(st.integers(0, 255))))
        else:
            data = wire(kind(draw(NUMBER)))
        spoken.append((now, data))
        for frame in splitter.feed(replies(device, now, data)):
            if isinstance(frame, IdentityFrame | Ack | Report):
                ticket = frame.ticket
    return spoken


@given(dialogues())
@settings(max_examples=200, deadline=None)
def test_two_independent_devices_reply_with_the_same_bytes(spoken: list[tuple[int, bytes]]):
    build("heli3dof-replay")
    python = still_endpoint()
    end = spoken[-1][0] + 100
    expected = b"".join(replies(python, now, data) for now, data in spoken)
    expected += until(python, end)
    said = (f"{now} !" if data == PAUSE else f"{now} > {data.hex()}" for now, data in spoken)
    text = "\n".join(said) + f"\n{end} .\n"
    answered = [line.split(" < ")[1] for line in run("heli3dof-replay", text=text)]
    assert answered == [piece.hex() + "00" for piece in expected.split(b"\0")[:-1]]
