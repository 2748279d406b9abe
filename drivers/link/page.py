"""``python -m heli3dof_drivers.link.page``: the tables of docs/protocol.md, from the code."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from pathlib import Path

from .frames import _FIELDS, _HEADER, _KINDS, Cause, Code, Type, command, wire
from .golden_transcripts import TRANSCRIPTS, sample, text

PAGE = Path("docs/protocol.md")
_SIGNS = {"B": "u8", "H": "u16", "h": "i16", "I": "u32", "i": "i32"}


def frames() -> str:
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


def numbered(names: Mapping[str, int]) -> str:
    return " · ".join(f"{value} {name}" for name, value in names.items())


def golden() -> str:
    return "\n\n".join(f"```\n[{name}]\n{text(t)}\n```" for name, t in TRANSCRIPTS.items())


def made(page: str) -> str:
    """The page with everything between its markers made anew."""
    parts = {
        "frames": frames(),
        "causes": numbered({c.name: c.value for c in Cause}),
        "codes": numbered({c.name: c.value for c in Code}),
        "golden": golden(),
    }
    for name, new in parts.items():
        page = re.sub(
            rf"(<!-- {name}: [^\n]*-->\n).*?(<!-- end of {name} -->)",
            lambda m, new=new: f"{m[1]}{new}\n{m[2]}",  # type: ignore[misc]
            page,
            flags=re.DOTALL,
        )
    both = len(wire(sample(0, 0, 0, 0, 0))) + len(command(0, 0, 0))
    return re.sub(r"(<!-- bytes -->).*?(<!-- end of bytes -->)", rf"\1 {both} \2", page)


def main() -> None:
    new = made(PAGE.read_text(encoding="utf-8"))
    if "--check" in sys.argv:
        sys.exit(new != PAGE.read_text(encoding="utf-8"))
    PAGE.write_text(new, encoding="utf-8")


if __name__ == "__main__":
    main()
