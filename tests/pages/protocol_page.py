"""The tables of docs/reference/protocol.md, and the file of golden transcripts."""

from __future__ import annotations

import re
from collections.abc import Mapping

from heli3dof_drivers.link.frames import _FIELDS, _HEADER, _KINDS, Cause, Code, Type, command, wire

from tests.drivers.link.golden_transcripts import TRANSCRIPTS, sample, text
from tests.pages.page import Page

_SIGNS = {"B": "u8", "H": "u16", "h": "i16", "I": "u32", "i": "i32"}


def _frames() -> str:
    """One row for each type."""
    rows = ["| type | frame | direction | bytes on the line | body |", "|---|---|---|---:|---|"]
    for t, kind in _KINDS.items():
        way = "device → host" if t & 0x80 else "host → device"
        codes = re.findall(r"\d+s|[A-Za-z]", kind.BODY.format[1:])
        body = ", ".join(
            f"{name} {_SIGNS.get(c, c.replace('s', ' bytes'))}"
            for name, c in zip(_FIELDS[t], codes, strict=True)
        )
        length = _HEADER.size + kind.BODY.size + 6 + (t == Type.ESTOP)
        rows.append(f"| 0x{t:02X} | {Type(t).name} | {way} | {length} | {body or '–'} |")
    return "\n".join(rows)


def _numbered(names: Mapping[str, int]) -> str:
    return " · ".join(f"{value} {name}" for name, value in names.items())


def _golden() -> str:
    return "\n\n".join(f"[{name}]\n{text(t)}" for name, t in TRANSCRIPTS.items())


def _bytes() -> str:
    both = len(wire(sample(0, 0, 0, 0, 0))) + len(command(0, 0, 0))
    return f"A sample and a command together are {both} bytes."


PAGE = Page(
    "docs/reference/protocol.md",
    {
        "frames": _frames,
        "causes": lambda: _numbered({c.name: c.value for c in Cause}),
        "codes": lambda: _numbered({c.name: c.value for c in Code}),
        "bytes": _bytes,
    },
)
GOLDEN_PAGE = Page("tests/drivers/link/golden_transcripts.txt", {"golden": _golden})
