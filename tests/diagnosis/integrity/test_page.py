"""docs/diagnosis.md lists the checks that there are."""

from __future__ import annotations

from heli3dof.diagnosis.integrity import checks
from heli3dof.diagnosis.integrity_page import PAGE as MADE
from tests.paths import ROOT

PAGE = (ROOT / "docs" / "diagnosis.md").read_text(encoding="utf-8")


def test_the_table_is_that_of_the_checks() -> None:
    fix = "run: python -m heli3dof.diagnosis.integrity_page docs/diagnosis.md"
    assert MADE.renewed(PAGE) == PAGE, fix


def test_every_check_is_named_once() -> None:
    names = [c.name for c in checks()]
    assert len(set(names)) == len(names)
    assert all(f"| `{n}` |" in PAGE for n in names)
