"""docs/explanation/diagnosis.md lists every integrity check."""

from __future__ import annotations

from heli3dof.integrity import checks
from tests.pages.integrity_page import PAGE


def test_every_check_is_named_once() -> None:
    names = [c.name for c in checks()]
    assert len(set(names)) == len(names)
    assert all(f"| `{n}` |" in PAGE.read() for n in names)
