"""The emulated device answers what docs/protocol.md says, byte by byte."""

from __future__ import annotations

from itertools import groupby

import pytest
from heli3dof_drivers.link.golden import TRANSCRIPTS, Line

from tests.drivers.emulator.still import still_endpoint


@pytest.mark.parametrize("name", TRANSCRIPTS)
def test_it_answers_the_golden_transcripts(name: str):
    endpoint = still_endpoint()
    for time_us, turn in groupby(TRANSCRIPTS[name], key=lambda line: line.time_us):
        lines = list(turn)
        said = b"".join(line.bytes for line in lines if line.speaker == "host")
        expected = b"".join(line.bytes for line in lines if line.speaker == "device")
        answered = endpoint.tick(time_us)
        if said:
            answered += endpoint.receive(time_us, said)
        assert answered == expected, explain(lines, answered)


def explain(lines: list[Line], answered: bytes) -> str:
    from heli3dof_drivers.link.frames import Splitter

    return f"{lines}\nanswered {Splitter().feed(answered)}"
